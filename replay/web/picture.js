// SPDX-License-Identifier: Apache-2.0
// Decodes the server's pictures. A Blob is registered with another process of the browser, which takes
// milliseconds of the page's time; ImageDecoder, which browsers have on secure origins, does without.

/** Decodes a JPEG. The promise is {source: to draw, width, height, close()}. */
export async function decodePicture(bytes) {
  if (!globalThis.ImageDecoder) return wrapped(await createImageBitmap(new Blob([bytes], { type: "image/jpeg" })));
  const decoder = new ImageDecoder({ data: bytes, type: "image/jpeg" });
  try {
    return wrapped((await decoder.decode()).image);
  } finally {
    decoder.close();
  }
}

function wrapped(source) {
  return { source, width: source.displayWidth ?? source.width, height: source.displayHeight ?? source.height, close: () => source.close() };
}
