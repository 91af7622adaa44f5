// Tells a video by its container.
#pragma once

namespace torquer {

/// True where the file is an MP4 of whole boxes, with ftyp first, moov and mdat.
bool IsMp4(int file);
/// True where the file begins as WebM does, and its segment follows.
bool IsWebm(int file);

}  // namespace torquer
