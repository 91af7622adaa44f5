#include "host/simulator/effects/region_spec.h"

#include <fmt/format.h>

#include "host/support/error.h"

namespace torquer::effects {

using vessel::Region;

namespace {

// Limits the cost: a stretch has two balls per radius, and each is compared with every other one.
constexpr double kMostStretchRadii = 1000;

void CheckShape(const RegionSpec& spec, StrictTable& table) {
  const int shapes =
      spec.center_mm.has_value() + spec.centerline.has_value() + spec.side_of_mm.has_value();
  if (shapes != 1) {
    table.Refuse(spec.center_mm    ? "center_mm"
                 : spec.centerline ? "centerline"
                                   : "side_of_mm",
                 "a region needs exactly one shape: a ball (center_mm, radius_mm), a stretch "
                 "(centerline, radius_mm) or a side of a plane (side_of_mm, side, edge_mm)");
  }
  const auto need = [&](bool there, const char* key) {
    if (!there) table.Refuse(key, "is missing; a region of this shape needs it");
  };
  if (spec.side_of_mm) {
    need(spec.side.has_value(), "side");
    need(spec.edge_mm.has_value(), "edge_mm");
  } else {
    need(spec.radius_mm.has_value(), "radius_mm");
  }
  const auto refuse = [&](bool there, const char* key, const char* shape) {
    if (there) table.Refuse(key, std::string("is valid only for ") + shape + "; remove it");
  };
  refuse(spec.side && !spec.side_of_mm, "side", "a side of a plane");
  refuse(spec.radius_mm && spec.side_of_mm, "radius_mm", "a ball or a stretch");
  refuse(spec.from_mm && !spec.centerline, "from_mm", "a stretch");
  refuse(spec.to_mm && !spec.centerline, "to_mm", "a stretch");
}

Region MakeStretch(const RegionSpec& spec, const EffectContext& context) {
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    spec.origin.Refuse("centerline",
                       "this vessel has no centerlines; give center_mm and radius_mm");
  }
  std::size_t index = 0;
  try {
    index = context.centerlines->Find(*spec.centerline);
  } catch (const UserError& error) {
    spec.origin.Refuse("centerline", error.what());
  }
  const vessel::Centerline& curve = context.centerlines->curves()[index];
  const double length = curve.length_mm();
  const double from = spec.from_mm.value_or(0);
  const double to = spec.to_mm.value_or(length);
  for (const auto& [key, value] : {std::pair("from_mm", from), std::pair("to_mm", to)}) {
    if (value > length) {
      spec.origin.Refuse(
          key, fmt::format("the centerline is {0:.4g} mm long; give 0 to {0:.4g}", length));
    }
  }
  if (!(to > from)) spec.origin.Refuse("to_mm", "must be more than from_mm");
  if (to - from > kMostStretchRadii * *spec.radius_mm) {
    spec.origin.Refuse("radius_mm",
                       fmt::format("is too small for {:.4g} mm of centerline; give at least {:.4g}",
                                   to - from, (to - from) / kMostStretchRadii));
  }
  return Region::Stretch(curve, from, to, *spec.radius_mm,
                         spec.edge_mm.value_or(*spec.radius_mm / 2));
}

Region MakeOne(const RegionSpec& spec, const EffectContext& context) {
  if (spec.centerline) return MakeStretch(spec, context);
  if (spec.side_of_mm) {
    return Region::Side(*spec.side_of_mm, context.Direction(*spec.side), *spec.edge_mm);
  }
  return Region::Ball(*spec.center_mm, *spec.radius_mm, spec.edge_mm.value_or(*spec.radius_mm / 2));
}

}  // namespace

const Keys<RegionSpec>& RegionKeys() {
  static const Keys<RegionSpec> keys =
      Keys<RegionSpec>()
          .Otherwise("unset: the region is not a ball")
          .Point("center_mm", &RegionSpec::center_mm, "mm", "center of the ball")
          .Otherwise("unset: the region is neither a ball nor a stretch")
          .Number("radius_mm", &RegionSpec::radius_mm, 0.1, 1e4, "mm",
                  "radius of the ball, or radius of the stretch around its centerline")
          .Otherwise("unset: the region is not a stretch")
          .Text("centerline", &RegionSpec::centerline, "centerline that the stretch follows")
          .Otherwise("0")
          .Number("from_mm", &RegionSpec::from_mm, 0, 1e5, "mm",
                  "arc length along the centerline at which the stretch begins")
          .Otherwise("end of the centerline")
          .Number("to_mm", &RegionSpec::to_mm, 0, 1e5, "mm",
                  "arc length along the centerline at which the stretch ends")
          .Otherwise("unset: the region is not a side of a plane")
          .Point("side_of_mm", &RegionSpec::side_of_mm, "mm",
                 "point on the plane that bounds the region, edge included")
          .Otherwise("unset: the region is not a side of a plane")
          .Direction("side", &RegionSpec::side,
                     "direction from the plane into the region, normal to the plane")
          .Otherwise("half of radius_mm")
          .Number("edge_mm", &RegionSpec::edge_mm, 0.01, 1000, "mm",
                  "width of the soft edge, over which the weight falls from 1 to 0: outside the "
                  "radius of a ball or a stretch, but inside a side, where it is 0 at the plane")
          .Checked(CheckShape)
          .Example(
              "centerline = \"lad\"\n"
              "from_mm = 50\n"
              "to_mm = 65\n"
              "radius_mm = 3\n");
  return keys;
}

Region MakeRegion(const RegionSpec& spec, const EffectContext& context) {
  Region region = MakeOne(spec, context);
  if (context.field != nullptr && context.centerlines != nullptr &&
      !region.MeetsLumen(*context.field, *context.centerlines, context.bounds_mm)) {
    spec.origin.Refuse(spec.centerline   ? "centerline"
                       : spec.side_of_mm ? "side_of_mm"
                                         : "center_mm",
                       "this region contains no part of the vessel's lumen; move it to the lumen, "
                       "enlarge it or remove it");
  }
  return region;
}

}  // namespace torquer::effects
