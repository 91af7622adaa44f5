#include "host/study/picture_prices.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/imaging/ct_body.h"
#include "host/simulator/effects/imaging/picture_renderer.h"
#include "host/study/cpu_time.h"

namespace torquer::study {

namespace {

using effects::CtBody;
using effects::CtVolume;

// A trunk of tissue with a spine, in the voxels of a usual CT.
std::shared_ptr<const CtBody> TrunkScan(bool quick) {
  const int part = quick ? 4 : 1;
  CtVolume scan;
  scan.size = {512 / part, 512 / part, 300 / part};
  const Eigen::Vector3d step = Eigen::Vector3d(0.7, 0.7, 0.8) * part;
  scan.step_mm = step.asDiagonal();
  scan.first_mm =
      -0.5 * step.cwiseProduct(Eigen::Vector3d(scan.size[0], scan.size[1], scan.size[2]));
  for (int k = 0; k < scan.size[2]; ++k) {
    for (int j = 0; j < scan.size[1]; ++j) {
      for (int i = 0; i < scan.size[0]; ++i) {
        const Eigen::Vector3d at = scan.first_mm + step.cwiseProduct(Eigen::Vector3d(i, j, k));
        const bool is_body = std::hypot(at[0] / 160, at[1] / 110) < 1;
        const bool is_spine = std::hypot(at[0], at[1] - 60) < 20;
        scan.values.push_back(is_spine  ? std::int16_t{400}
                              : is_body ? std::int16_t{50}
                                        : std::int16_t{-1000});
      }
    }
  }
  return std::make_shared<const CtBody>(std::move(scan), effects::CtAttenuation(60, 70),
                                        Eigen::Vector3d::UnitZ());
}

struct PicturePrice {
  std::string body;
  double moving_ms = 0;   // median while the C-arm turns
  double finer_ms = 0;    // largest after it has come to rest
  double resting_ms = 0;  // median once all rows are fine
  int finer_pictures = 0;
};

double RenderMs(effects::PictureRenderer& renderer, const effects::XrayFrame& frame,
                effects::ImageSource::Picture& picture) {
  const double start_s = ThreadCpuSeconds();
  renderer.Render(frame, picture);
  return 1e3 * (ThreadCpuSeconds() - start_s);
}

double MedianMs(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

PicturePrice MeasurePictures(const std::string& body, std::shared_ptr<const CtBody> scan,
                             int pictures) {
  effects::FluoroscopySettings settings;
  settings.scan = std::move(scan);
  const effects::DyePoints no_dye;
  effects::PictureRenderer renderer(settings, no_dye);
  effects::XrayFrame frame;
  effects::ImageSource::Picture picture;
  PicturePrice price{.body = body};
  std::vector<double> moving;
  for (int n = 0; n < pictures; ++n) {
    frame.controls.lao_rad = 0.05 * n;
    ++frame.number;
    moving.push_back(RenderMs(renderer, frame, picture));
  }
  price.moving_ms = MedianMs(moving);
  effects::Plane plane;
  plane.Clear(picture.width, picture.height);
  if (settings.scan != nullptr) {
    const int parts = CtBody::FineParts(INT32_MAX, plane);
    while (CtBody::FineParts(price.finer_pictures, plane) < parts) ++price.finer_pictures;
  }
  for (frame.still = 1; frame.still <= price.finer_pictures; ++frame.still) {
    ++frame.number;
    price.finer_ms = std::max(price.finer_ms, RenderMs(renderer, frame, picture));
  }
  std::vector<double> resting;
  for (int n = 0; n < pictures; ++n) {
    ++frame.number;
    resting.push_back(RenderMs(renderer, frame, picture));
  }
  price.resting_ms = MedianMs(resting);
  return price;
}

}  // namespace

void PricePictures(StudyRun& run) {
  const int pictures = run.quick() ? 3 : 15;
  const PicturePrice prices[] = {MeasurePictures("model", nullptr, pictures),
                                 MeasurePictures("ct", TrunkScan(run.quick()), pictures)};
  Table table{"An X-ray picture of 512 x 512, in its own thread; thread-CPU time",
              {"body", "C-arm turns, median ms", "gets finer, largest ms", "pictures until fine",
               "rests, median ms"},
              {}};
  for (const PicturePrice& price : prices) {
    const std::string name = "picture of body " + price.body;
    run.Record(name, "moving_ms_p50", price.moving_ms, "ms");
    run.Record(name, "finer_ms_max", price.finer_ms, "ms");
    run.Record(name, "finer_pictures", price.finer_pictures, "");
    run.Record(name, "resting_ms_p50", price.resting_ms, "ms");
    table.rows.push_back({price.body, Number(price.moving_ms), Number(price.finer_ms),
                          std::to_string(price.finer_pictures), Number(price.resting_ms)});
  }
  run.Section("The price of a picture");
  run.Show(table);
  run.Say(
      "A picture each 67 ms is 15 each second. The pictures here have no dye and no instrument.");
}

}  // namespace torquer::study
