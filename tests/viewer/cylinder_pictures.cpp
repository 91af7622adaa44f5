// cylinder_pictures FOLDER [SEEDS] writes X-ray pictures of contrast-filled cylinders of known
// diameter, for the tests of the page's measurements. They are drawn as the simulator draws
// vessels. Diameters, fields and heights of the table differ, each with SEEDS seeds of the noise
// (1). A picture is FOLDER/NUMBER.jpg. FOLDER/index.json has a list of them, with their geometry.
#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/effects/imaging/picture_renderer.h"
#include "host/simulator/jpeg_encoder.h"

namespace {

using Eigen::Vector3d;
using torquer::effects::DyePoints;
using torquer::effects::FluoroscopySettings;
using torquer::effects::ImagePoint;
using torquer::effects::ImageSource;
using torquer::effects::PictureRenderer;
using torquer::effects::Projection;
using torquer::effects::XrayFrame;

constexpr double kHalfLengthMm = 40;
constexpr double kNarrowHalfMm = 6;  // half the length of a narrowing
constexpr std::size_t kMostBytes = 60000;

struct Vessel {
  double diameter_mm;
  double narrowing;  // share by which the middle is narrower
};

FluoroscopySettings System(std::uint64_t seed) {
  FluoroscopySettings system;
  system.arm.detector_mm = 280;  // 200 mm at the isocenter
  system.seed = seed;
  return system;
}

// A straight vessel through the isocenter, in its plane; the direction is no axis of the pixels.
DyePoints PointsOf(const Vessel& vessel, const FluoroscopySettings& system, Vector3d& along) {
  constexpr double kTurnRad = 0.5;
  along = std::cos(kTurnRad) * system.arm.axes.left + std::sin(kTurnRad) * system.arm.axes.superior;
  DyePoints dye;
  constexpr int kPoints = 401;
  for (int i = 0; i < kPoints; ++i) {
    const double s = kHalfLengthMm * (2.0 * i / (kPoints - 1) - 1);
    const double shape =
        std::abs(s) < kNarrowHalfMm ? (1 + std::cos(std::numbers::pi * s / kNarrowHalfMm)) / 2 : 0;
    dye.points.push_back(
        {s * along, along, vessel.diameter_mm / 2 * (1 - vessel.narrowing * shape), 0});
  }
  dye.branches = {{0, dye.points.size()}};
  dye.cells.resize(dye.points.size());
  return dye;
}

class Writer {
 public:
  explicit Writer(std::string folder) : folder_(std::move(folder)) {}

  void Write(const Vessel& vessel, double magnification, double height_mm, std::uint64_t seed) {
    const FluoroscopySettings system = System(seed);
    Vector3d along;
    const DyePoints dye = PointsOf(vessel, system, along);
    PictureRenderer renderer(system, dye);
    XrayFrame frame;
    frame.controls.imaging.magnification = magnification;
    frame.controls.table.height_mm = height_mm;
    frame.has_dye = true;
    constexpr float kIodine_1_mm = 0.1F;
    frame.dye_1_mm.assign(dye.points.size(), kIodine_1_mm);
    ImageSource::Picture picture;
    renderer.Render(frame, picture);
    const std::vector<std::uint8_t>& bytes = encoder_.Encode(picture, kMostBytes).bytes;
    const std::string path = folder_ + "/" + std::to_string(count_) + ".jpg";
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));

    // Two points of the axis, as a person picks them.
    const Projection projection = system.ProjectionOf(frame.controls);
    const double picked_mm = 22 / magnification + 8;
    const ImagePoint from = projection.Project(-picked_mm * along);
    const ImagePoint to = projection.Project(picked_mm * along);
    char line[400];
    std::snprintf(
        line, sizeof line,
        "%s{\"diameter_mm\": %g, \"narrowing\": %g, \"magnification\": %g, \"height_mm\": %g, "
        "\"sod_mm\": %g, \"field_mm\": %.17g, \"from\": [%.3f, %.3f], \"to\": [%.3f, %.3f], "
        "\"picked_mm\": %.17g}",
        count_ == 0 ? "" : ",\n", vessel.diameter_mm, vessel.narrowing, magnification, height_mm,
        system.arm.sod_mm,
        system.arm.detector_mm / magnification * system.arm.sod_mm / system.arm.sid_mm, from.column,
        from.row, to.column, to.row, 2 * picked_mm);
    index_ += line;
    ++count_;
  }

  void Finish() const { std::ofstream(folder_ + "/index.json") << "[" << index_ << "]\n"; }

 private:
  std::string folder_;
  std::string index_;
  int count_ = 0;
  torquer::simulator::JpegEncoder encoder_;
};

}  // namespace

int main(int argc, char** argv) {
  const int seeds = argc == 3 ? std::atoi(argv[2]) : 1;
  if (argc < 2 || argc > 3 || seeds < 1) {
    std::fprintf(stderr, "usage: cylinder_pictures FOLDER [SEEDS]\n");
    return 2;
  }
  Writer writer(argv[1]);
  constexpr Vessel kVessels[] = {{2.5, 0}, {4, 0}, {8, 0}, {4, 0.5}};
  std::uint64_t seed = 0;
  for (const Vessel& vessel : kVessels) {
    for (const double magnification : {1.0, 2.0, 3.0}) {
      for (const double height_mm : {-100.0, 0.0, 100.0}) {
        for (int k = 0; k < seeds; ++k) {
          writer.Write(vessel, magnification, height_mm, ++seed);
        }
      }
    }
  }
  // An occlusion.
  writer.Write({4, 1}, 2, 0, 1);
  writer.Finish();
}
