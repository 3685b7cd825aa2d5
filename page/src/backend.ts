// Who answers the page: the service that serves it, or this browser, where the page says so itself,
// as `meshconv3d page` writes it.

import type { Backend } from "./api";
import { http } from "./http";

const build = document.querySelector<HTMLMetaElement>('meta[name="meshconv3d-build"]')?.content;

export const isLocal = build !== undefined;
export const backend: Backend = build ? await (await import("./local")).open(build) : http;
