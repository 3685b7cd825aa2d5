// What the extension of a file's name tells.

export const extensionOf = (name: string) => name.split(".").pop()!.toLowerCase();
