// The formats that the service reads, by file extension.

export const EXTENSIONS = ["obj", "off", "stl", "ply", "glb", "gltf", "3mf"] as const;

export type Extension = (typeof EXTENSIONS)[number];

export const extensionOf = (name: string) => name.split(".").pop()!.toLowerCase();

/** Formats for making things, where up is the third axis. */
export const isZUp = (name: string) => ["stl", "3mf"].includes(extensionOf(name));
