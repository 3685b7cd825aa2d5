// What the extension of a file's name tells.

export const extensionOf = (name: string) => name.split(".").pop()!.toLowerCase();

/** Formats for making things, where up is the third axis. */
export const isZUp = (name: string) => ["stl", "3mf"].includes(extensionOf(name));
