// Image trailer: the description of this image, in its own page at the end of the application's
// flash. Length and CRC are filled in when the image is complete (CMakeLists.txt).
#include "firmware/board/atmega32u4/clock.h"
#include "firmware/src/version.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_reports.h"

extern "C" {
extern const torquer::protocol::ImageTrailer torquer_image_trailer;
const torquer::protocol::ImageTrailer torquer_image_trailer
    __attribute__((used, section(".image_trailer"))) = {torquer::protocol::kImageMagic,
                                                        0,
                                                        torquer::board::kImageBoard,
                                                        torquer::board::kClock,
                                                        torquer::firmware::kVersionMajor,
                                                        torquer::firmware::kVersionMinor,
                                                        torquer::firmware::kVersionPatch,
                                                        torquer::protocol::kProtocolVersion,
                                                        0};
}
