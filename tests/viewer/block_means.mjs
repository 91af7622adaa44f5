// Block comparison of pictures: block means are insensitive to noise, smoothed edges and single
// glyphs. A picture is a data: URL, which the browser decodes.

export const BLOCK_PX = 16;

/** Red, green and blue of each block, row by row, and how many are in a row. */
export function blockMeans(page, url) {
  return page.evaluate(async ([source, side]) => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const [columns, rows] = [Math.floor(image.width / side), Math.floor(image.height / side)];
    const copy = new OffscreenCanvas(image.width, image.height).getContext("2d");
    copy.drawImage(image, 0, 0);
    const { data } = copy.getImageData(0, 0, image.width, image.height);
    const means = new Array(3 * columns * rows).fill(0);
    for (let y = 0; y < rows * side; ++y) {
      for (let x = 0; x < columns * side; ++x) {
        const block = 3 * (Math.floor(y / side) * columns + Math.floor(x / side));
        for (let c = 0; c < 3; ++c) means[block + c] += data[4 * (y * image.width + x) + c] / (side * side);
      }
    }
    return { columns, rows, means };
  }, [url, BLOCK_PX]);
}

/** Number of blocks that differ by more than `tolerance` of 255 in a color, and the largest difference. */
export function difference(first, second, tolerance) {
  if (first.columns !== second.columns || first.rows !== second.rows) return { blocks: Infinity, largest: 255 };
  let [blocks, largest] = [0, 0];
  for (let block = 0; block < first.means.length; block += 3) {
    const most = Math.max(...[0, 1, 2].map((c) => Math.abs(first.means[block + c] - second.means[block + c])));
    if (most > tolerance) ++blocks;
    largest = Math.max(largest, most);
  }
  return { blocks, largest };
}
