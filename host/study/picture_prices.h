// Picture prices: time of an X-ray picture with each body.
#pragma once

#include "host/study/study.h"

namespace torquer::study {

/// Measures pictures of 512 x 512 of a body alone, and records and shows their prices. The bodies
/// are the model and a scan of 512 x 512 x 300 voxels. With --quick, the scan has a quarter of the
/// voxels along each axis.
void PricePictures(StudyRun& run);

}  // namespace torquer::study
