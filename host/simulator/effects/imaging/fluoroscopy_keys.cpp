#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/imaging/ct_carving.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/support/error.h"

namespace torquer::effects {

using Eigen::Vector3d;

namespace {

struct FluoroscopySpec : TableSpec {
  enum class BodyKind { kModel, kCt };

  FluoroscopySettings::Mode mode = FluoroscopySettings::Mode::kPlain;
  BodyKind body = BodyKind::kModel;
  BodyRegion body_region = BodyRegion::kTrunk;
  std::optional<std::string> ct_file;
  double energy_keV = ScanSource().picture_keV;
  double ct_keV = ScanSource().ct_keV;
  double ct_blur_mm = ScanSource().blur_mm;
  std::optional<Vector3d> isocenter_mm;
  std::optional<Vector3d> body_center_mm;
  int width_px = 512;
  int height_px = 512;
  double sid_mm = 1050;
  double sod_mm = 750;
  double detector_mm = 300;
  double pictures_per_s = 15;
  double photons = 600;
  double scatter_to_primary = 0;
  double tube_kV = 80;
  double tube_mA = 10;
  double tube_limit_mA = 1000;
  double acquisition_dose = 10;
  double pulse_ms = 8;
  double tube_mGy_mAs = 0.06;
  double gain = 0.4;
  double iodine_1_mm_mg_mL = 7.6e-4;
  double body_width_mm = 320;
  double body_depth_mm = 220;
  double tissue_1_mm = 0.018;
  double spine_1_mm = 0.01;
  int seed = 1;
};

const Keys<FluoroscopySpec>& FluoroscopyKeys() {
  using Spec = FluoroscopySpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Choice("mode", &Spec::mode, {"plain", "subtraction", "roadmap", "cine"},
                  "plain: the detected picture; subtraction: minus the first picture since the "
                  "pedal went down; roadmap: the densest contrast so far as a bright map; "
                  "cine: plain, with the dose of an acquisition")
          .Otherwise("center of the vessel")
          .Point("isocenter_mm", &Spec::isocenter_mm, "mm",
                 "isocenter, the point about which the C-arm turns")
          .Otherwise("center of the vessel")
          .Point("body_center_mm", &Spec::body_center_mm, "mm", "center of the patient's body")
          .Integer("width_px", &Spec::width_px, 64, 1024, "number of columns in the picture")
          .Integer("height_px", &Spec::height_px, 64, 1024, "number of rows in the picture")
          .Number("sid_mm", &Spec::sid_mm, 500, 2000, "mm", "source-to-detector distance (SID)")
          .Number("sod_mm", &Spec::sod_mm, 200, 1900, "mm", "source-to-isocenter distance (SOD)")
          .Number("detector_mm", &Spec::detector_mm, 50, 600, "mm",
                  "width of the detector's field of view")
          .Number("pictures_per_s", &Spec::pictures_per_s, 1, 60, "1/s",
                  "frame rate: X-ray pulses per second while the pedal is down")
          .Number("photons", &Spec::photons, 10, 1e7, "",
                  "number of unscattered photons that reach a pixel behind the body's mean "
                  "attenuation, in fluoroscopy")
          .Number(
              "acquisition_dose", &Spec::acquisition_dose, 1, 1000, "",
              "dose of a picture of subtraction or cine relative to that of fluoroscopy, the other "
              "modes")
          .Number("scatter_to_primary", &Spec::scatter_to_primary, 0, 20, "",
                  "ratio of scattered to unscattered photons, equal in every pixel; 1 to 5 behind "
                  "a trunk, a fifth of that behind a grid")
          .Number("tube_kV", &Spec::tube_kV, 40, 150, "kV",
                  "peak voltage of the tube, as displayed; its output and all attenuation "
                  "coefficients are those at this voltage")
          .Number("tube_mA", &Spec::tube_mA, 0.1, 2000, "mA",
                  "tube current of fluoroscopy for 200 mm of tissue; automatic exposure adapts it "
                  "to the body's thickness and the field")
          .Number("tube_limit_mA", &Spec::tube_limit_mA, 0.1, 5000, "mA",
                  "largest tube current; where automatic exposure would need more, pictures have "
                  "more noise")
          .Number("pulse_ms", &Spec::pulse_ms, 0.1, 100, "ms", "duration of an X-ray pulse")
          .Number("tube_mGy_mAs", &Spec::tube_mGy_mAs, 1e-4, 1, "mGy/(mA s)",
                  "air kerma of the tube at 1 m per mA s, at its voltage and with its filter")
          .Number("gain", &Spec::gain, 0.01, 10, "",
                  "contrast gain: fraction of the gray range that a factor e in intensity spans")
          .Number("iodine_1_mm_mg_mL", &Spec::iodine_1_mm_mg_mL, 0, 0.01, "1/mm per mg/mL",
                  "attenuation coefficient of iodine per concentration")
          .Choice("body", &Spec::body, {"model", "ct"},
                  "model: analytic shapes, by body_region; ct: the patient's scan in ct_file, with "
                  "blood in place of the contrast agent in the lumen of the vessel")
          .Otherwise("none")
          .Text(
              "ct_file", &Spec::ct_file,
              "scan in Hounsfield units, an uncompressed MetaImage (.mha) of 16-bit values in LPS "
              "(patient_axes gives the directions); its path is relative to the scene file")
          .Number("energy_keV", &Spec::energy_keV, CtAttenuation::kLeastKeV,
                  CtAttenuation::kMostKeV, "keV",
                  "effective energy of the X-rays, for the attenuation of a scan")
          .Number("ct_keV", &Spec::ct_keV, CtAttenuation::kLeastKeV, CtAttenuation::kMostKeV, "keV",
                  "effective energy of the CT, for the attenuation of its bone")
          .Number("ct_blur_mm", &Spec::ct_blur_mm, 0, 3, "mm",
                  "standard deviation of the CT's point spread, by which the contrast agent in the "
                  "lumen has spread into its surroundings")
          .Choice("body_region", &Spec::body_region,
                  {"trunk", "head", "neck", "arch", "heart", "abdomen", "pelvis"},
                  "part of the patient at the body's center. trunk: an elliptic trunk with a "
                  "spine, without ends; the others: heights in a patient with skull, ribs, lungs, "
                  "diaphragm and pelvis")
          .Number("body_width_mm", &Spec::body_width_mm, 0, 1000, "mm",
                  "width of the patient's body, from left to right; 0: no body")
          .Number("body_depth_mm", &Spec::body_depth_mm, 10, 1000, "mm",
                  "depth of the patient's body, from front to back")
          .Number("tissue_1_mm", &Spec::tissue_1_mm, 0, 1, "1/mm",
                  "attenuation coefficient of the body")
          .Number("spine_1_mm", &Spec::spine_1_mm, 0, 1, "1/mm",
                  "attenuation coefficient of the spine, in addition to that of the body")
          .Integer("seed", &Spec::seed, 0, 1000000000,
                   "seed of the picture noise; the same seed repeats the same pictures")
          .Checked([](const Spec& spec, StrictTable& table) {
            if (spec.sod_mm >= spec.sid_mm) {
              table.Refuse(
                  "sod_mm",
                  "must be less than sid_mm: the isocenter lies between source and detector");
            }
            const bool is_ct = spec.body == Spec::BodyKind::kCt;
            if (is_ct && !spec.ct_file) table.Refuse("body", "needs ct_file, the path of the scan");
            for (const char* key : {"ct_file", "energy_keV", "ct_keV", "ct_blur_mm"}) {
              if (!is_ct && table.Has(key)) table.Refuse(key, "is for body = \"ct\"; leave it out");
            }
            for (const char* key : {"body_center_mm", "body_region", "body_width_mm",
                                    "body_depth_mm", "tissue_1_mm", "spine_1_mm"}) {
              if (is_ct && table.Has(key))
                table.Refuse(key, "is for body = \"model\"; leave it out");
            }
          })
          .Example(
              "mode = \"subtraction\"\n"
              "isocenter_mm = [22, -4, -28]\n"
              "detector_mm = 200\n");
  return keys;
}

CtLumen LumenOf(const EffectContext& context) {
  CtLumen lumen;
  lumen.bounds_mm = context.bounds_mm;
  if (const auto& surface = context.vessel->surface) {
    lumen.clearance = [&source = surface->surface()](const Vector3d& point_mm) {
      return source.Distance(point_mm);
    };
  } else {
    lumen.clearance = [field = context.vessel->field.get()](const Vector3d& point_mm) {
      return field->Clearance(point_mm);
    };
    lumen.steepest = context.vessel->field->LipschitzBound();
  }
  return lumen;
}

std::shared_ptr<const CtBody> MakeScan(const FluoroscopySpec& spec, const ScanSource& source,
                                       const EffectContext& context) {
  const auto* other = dynamic_cast<const Fluoroscopy*>(context.other);
  if (other != nullptr && other->settings().scan_source == source) return other->settings().scan;
  CtVolume volume;
  try {
    volume = ReadCtVolume(source.file, context.axes);
  } catch (const UserError& error) {
    spec.origin.Refuse("ct_file", error.what());
  }
  const CtLumen lumen = LumenOf(context);
  if (!Overlaps(lumen, volume)) {
    const Vector3d first = volume.first_mm;
    const Vector3d vessel = lumen.bounds_mm.center();
    spec.origin.Refuse(
        "ct_file",
        fmt::format("the vessel, about ({:.0f}, {:.0f}, {:.0f}) mm, lies outside the scan, whose "
                    "first voxel is at ({:.0f}, {:.0f}, {:.0f}) mm; give the scan from which the "
                    "vessel was made, and check patient_axes",
                    vessel[0], vessel[1], vessel[2], first[0], first[1], first[2]));
  }
  CarveLumen(lumen, source.blur_mm, volume);
  return std::make_shared<const CtBody>(
      std::move(volume), CtAttenuation(source.picture_keV, source.ct_keV), context.axes.superior);
}

std::unique_ptr<Effect> MakeFluoroscopy(const FluoroscopySpec& spec, const EffectContext& context) {
  FluoroscopySettings s;
  s.mode = spec.mode;
  s.arm.axes = s.body.axes = context.axes;
  s.arm.isocenter_mm = spec.isocenter_mm.value_or(context.bounds_mm.center());
  s.body.center_mm = spec.body_center_mm.value_or(context.bounds_mm.center());
  s.arm.width = spec.width_px;
  s.arm.height = spec.height_px;
  s.arm.sid_mm = spec.sid_mm;
  s.arm.sod_mm = spec.sod_mm;
  s.arm.detector_mm = spec.detector_mm;
  s.pictures_per_s = spec.pictures_per_s;
  s.photons = spec.photons;
  s.scatter_to_primary = spec.scatter_to_primary;
  s.tube_kV = spec.tube_kV;
  s.tube_mA = spec.tube_mA;
  s.tube_limit_mA = spec.tube_limit_mA;
  s.acquisition_dose = spec.acquisition_dose;
  s.pulse_ms = spec.pulse_ms;
  s.tube_mGy_mAs = spec.tube_mGy_mAs;
  s.gain = spec.gain;
  s.iodine_1_mm_mg_mL = spec.iodine_1_mm_mg_mL;
  s.body.width_mm = spec.body_width_mm;
  s.body.depth_mm = spec.body_depth_mm;
  s.body.tissue_1_mm = spec.tissue_1_mm;
  s.body.spine_1_mm = spec.spine_1_mm;
  s.body.region = spec.body_region;
  s.body.tubes = TubesOf(s.body);
  s.seed = static_cast<std::uint64_t>(spec.seed);
  if (spec.body == FluoroscopySpec::BodyKind::kCt) {
    s.scan_source = {.file = (context.folder / *spec.ct_file).string(),
                     .picture_keV = spec.energy_keV,
                     .ct_keV = spec.ct_keV,
                     .blur_mm = spec.ct_blur_mm};
    s.scan = MakeScan(spec, s.scan_source, context);
  }
  return MakeFluoroscopy(s, context);
}

}  // namespace

std::unique_ptr<Fluoroscopy> MakeFluoroscopy(const FluoroscopySettings& settings,
                                             const EffectContext& context) {
  std::vector<const vessel::FieldMotion*> motions;
  if (context.earlier != nullptr) {
    for (const std::unique_ptr<Effect>& effect : *context.earlier) {
      if (const vessel::FieldMotion* motion = effect->motion()) motions.push_back(motion);
    }
  }
  return std::make_unique<Fluoroscopy>(settings, context.wire, FindEarlier<Contrast>(context),
                                       std::move(motions), context.instruments);
}

EffectKind FluoroscopyKind() {
  return {.name = "fluoroscopy",
          .summary = "X-ray picture at the C-arm's angles, while the pedal is down",
          .roles = "image, observer",
          .keys = Any(FluoroscopyKeys()),
          .make = MakeWith(MakeFluoroscopy)};
}

}  // namespace torquer::effects
