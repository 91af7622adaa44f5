// Check of a video file by its container format.
#pragma once

namespace torquer {

/// True if the file is an MP4 of complete boxes, with ftyp first, moov and mdat.
bool IsMp4(int file);
/// True if the file begins with a WebM header followed by a segment.
bool IsWebm(int file);

}  // namespace torquer
