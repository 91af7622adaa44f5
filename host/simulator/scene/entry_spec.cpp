#include "host/simulator/scene/entry_spec.h"

namespace torquer::scene {

namespace {

void CheckEntry(const EntrySpec& spec, StrictTable& table) {
  if (spec.point_mm.has_value() == spec.centerline.has_value()) {
    table.Refuse(spec.point_mm ? "point_mm" : "centerline",
                 spec.point_mm ? "cannot be given together with centerline; give one of the two"
                               : "is missing; give centerline, or point_mm and direction");
  }
  if (spec.point_mm.has_value() != spec.direction.has_value()) {
    table.Refuse("direction", spec.direction ? "needs point_mm; give point_mm or remove direction"
                                             : "is missing; point_mm needs it");
  }
  if (spec.direction && !(spec.direction->norm() > 1e-9)) {
    table.Refuse("direction", "has no length; give a direction");
  }
  if (!spec.path_mm.empty() && !spec.point_mm) {
    table.Refuse("path_mm", "needs point_mm; give point_mm and direction, or remove path_mm");
  }
  if (spec.towards && !spec.centerline) {
    table.Refuse("towards", "needs centerline; give centerline or remove towards");
  }
}

}  // namespace

const Keys<EntrySpec>& EntryKeys() {
  using Spec = EntrySpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Otherwise("unset: give centerline")
          .Point("point_mm", &Spec::point_mm, "mm", "entry point of the instruments")
          .Otherwise("unset: give centerline")
          .Point("direction", &Spec::direction, "",
                 "direction of the instruments at the entry point")
          .Otherwise("none")
          .Points(
              "path_mm", &Spec::path_mm, 1, "mm",
              "points of the path from point_mm on, along which the instruments lie at the start")
          .Otherwise("unset: give point_mm and direction")
          .Text("centerline", &Spec::centerline,
                "centerline on which the instruments enter, in its direction of increasing arc "
                "length")
          .Number("at_mm", &Spec::at_mm, 0, 1e5, "mm",
                  "arc length of the entry along its centerline")
          .Otherwise("none: they point along centerline")
          .Text("towards", &Spec::towards,
                "second centerline, to which the instruments point at the entry")
          .Number("towards_at_mm", &Spec::towards_at_mm, 0, 1e5, "mm",
                  "arc length of the target place along the centerline in towards")
          .Pair("offset_mm", &Spec::offset_mm, -50, 50, "mm",
                "sideways displacement of the entry and of the path along the centerline: towards "
                "the first normal, and towards the second")
          .Checked(CheckEntry)
          .Example(
              "centerline = \"curve_14\"\n"
              "at_mm = 15\n"
              "towards = \"curve_00\"\n");
  return keys;
}

}  // namespace torquer::scene
