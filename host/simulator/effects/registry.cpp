#include <sstream>

#include "host/simulator/effects/assessment.h"
#include "host/simulator/effects/breathing.h"
#include "host/simulator/effects/catheter.h"
#include "host/simulator/effects/compliance.h"
#include "host/simulator/effects/contrast.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/flow.h"
#include "host/simulator/effects/fluoroscopy.h"
#include "host/simulator/effects/friction.h"
#include "host/simulator/effects/gravity.h"
#include "host/simulator/effects/heartbeat.h"
#include "host/simulator/effects/point_load.h"
#include "host/simulator/effects/sections.h"
#include "host/simulator/effects/torsion.h"
#include "host/simulator/effects/wall_force.h"
#include "host/support/error.h"
#include "host/support/nearest_name.h"

namespace torquer::effects {

const std::vector<EffectKind>& AllEffects() {
  // In the order in which they are made: what needs another comes after it.
  static const std::vector<EffectKind> kinds = {
      SectionsKind(),   TorsionKind(),  CatheterKind(), HeartbeatKind(),   BreathingKind(),
      ComplianceKind(), FrictionKind(), GravityKind(),  PointLoadKind(),   WallForceKind(),
      AssessmentKind(), FlowKind(),     ContrastKind(), FluoroscopyKind(),
  };
  return kinds;
}

const EffectKind& FindEffect(const std::string& name, const std::string& where) {
  std::vector<std::string> known;
  for (const EffectKind& kind : AllEffects()) {
    if (name == kind.name) return kind;
    known.emplace_back(kind.name);
  }
  std::string all;
  for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
  const std::string near = NearestName(name, known);
  throw UserError(where + ": effects." + name + ": there is no such effect; " +
                  (near.empty() ? "" : "did you mean " + near + "? ") + "Known: " + all);
}

double Key::Read(StrictTable& keys) const {
  return fallback ? keys.Number(name, lowest, highest, *fallback)
                  : keys.Number(name, lowest, highest);
}

namespace {

std::string Short(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

std::string DescribeEffects(bool markdown) {
  std::ostringstream out;
  const char* name_open = markdown ? "### " : "";
  const char* item = markdown ? "- `" : "    ";
  const char* item_end = markdown ? "`" : "";
  for (const EffectKind& kind : AllEffects()) {
    out << name_open << kind.name << (markdown ? "\n\n" : ": ") << kind.summary << "\n";
    if (markdown) out << "\n";
    out << (markdown ? "Role: " : "    role: ") << kind.roles;
    if (*kind.needs != 0) out << "; needs [effects." << kind.needs << "]";
    if (*kind.excludes != 0) out << "; not with [effects." << kind.excludes << "]";
    out << (markdown ? "\n\n" : "\n");
    for (const Key& key : kind.keys) {
      out << item << key.name << item_end << ": " << key.meaning;
      if (*key.unit != 0) out << ", " << key.unit;
      out << "; " << Short(key.lowest) << " to " << Short(key.highest) << ", ";
      if (key.fallback) {
        out << "if not given " << Short(*key.fallback);
      } else {
        out << "must be given";
      }
      out << "\n";
    }
    for (const OtherKey& key : kind.other_keys) {
      out << item << key.name << item_end << ": " << key.meaning << "; " << key.form << "\n";
    }
    out << "\n";
  }
  return out.str();
}

}  // namespace torquer::effects
