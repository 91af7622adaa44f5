#include <fmt/format.h>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/blood/flow.h"
#include "host/simulator/effects/contact/compliance.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/effects/contact/friction_between.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/effects/imaging/lateral_plane.h"
#include "host/simulator/effects/instruments/clearance.h"
#include "host/simulator/effects/instruments/self_contact.h"
#include "host/simulator/effects/instruments/torsion.h"
#include "host/simulator/effects/loads/gravity.h"
#include "host/simulator/effects/loads/inertia.h"
#include "host/simulator/effects/loads/point_load.h"
#include "host/simulator/effects/motion/breathing.h"
#include "host/simulator/effects/motion/heartbeat.h"
#include "host/simulator/effects/observers/assessment.h"
#include "host/simulator/effects/observers/internal_forces.h"
#include "host/simulator/effects/observers/outlets.h"
#include "host/simulator/effects/observers/patient_monitor.h"
#include "host/simulator/effects/observers/segment_error.h"
#include "host/simulator/effects/observers/wall_force.h"

namespace torquer::effects {

const std::vector<EffectKind>& AllEffects() {
  static const std::vector<EffectKind> kinds = {
      TorsionKind(),        ClearanceKind(),    SelfContactKind(), HeartbeatKind(),
      BreathingKind(),      ComplianceKind(),   FrictionKind(),    FrictionBetweenKind(),
      GravityKind(),        InertiaKind(),      PointLoadKind(),   WallForceKind(),
      InternalForcesKind(), AssessmentKind(),   FlowKind(),        ContrastKind(),
      FluoroscopyKind(),    LateralPlaneKind(), OutletsKind(),     PatientMonitorKind(),
      SegmentErrorKind(),
  };
  return kinds;
}

int FindInstrument(const std::vector<Instrument>& instruments, const std::string& name,
                   const TableSpec& spec, const std::string& key) {
  std::string known;
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    if (instruments[k].name == name) return static_cast<int>(k);
    known += (known.empty() ? "" : ", ") + instruments[k].name;
  }
  spec.origin.Refuse(key, "there is no such instrument; this scene has: " + known);
}

Eigen::Vector3d EffectContext::Direction(const DirectionSpec& spec) const {
  const std::vector<std::string>& names = PatientDirections();
  const Eigen::Vector3d towards[] = {axes.left, axes.posterior, axes.superior};
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (spec.name != names[k]) continue;
    return k % 2 == 0 ? towards[k / 2] : Eigen::Vector3d(-towards[k / 2]);
  }
  return spec.vector.normalized();
}

std::string DescribeEffects() {
  std::string out;
  for (const EffectKind& kind : AllEffects()) {
    out += fmt::format("{}: {}\n    role: {}", kind.name, kind.summary, kind.roles);
    if (!kind.needs.empty()) out += fmt::format("; needs [effects.{}]", kind.needs);
    out += "\n";
  }
  return out;
}

}  // namespace torquer::effects
