#include "host/python/navigation.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <limits>
#include <utility>

#include "host/support/within.h"

namespace torquer::python {

namespace {

// Points in an observed vector: of the wire from its tip, and of the route from its nearest point
// on. Their spacing is kApart_mm.
constexpr std::size_t kWirePoints = 4;
constexpr std::size_t kRoutePoints = 4;
constexpr double kApart_mm = 5;
constexpr double kLargest = std::numeric_limits<double>::max();

// Search range around the last point, in points, because a route may pass the same place twice.
constexpr std::size_t kReach = 30;

double Distance(const Point& a, const Point& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

void CheckRoute(const std::vector<Point>& route) {
  const auto within = RequireWithin<Error>;
  within("the number of points of the route", static_cast<double>(route.size()), 1, 1e6);
  for (const Point& point : route) {
    for (const double x : point) within("a coordinate of the route", x, -1e9, 1e9);
  }
}

NavigationTask Checked(NavigationTask task, std::size_t instruments) {
  const auto within = RequireWithin<Error>;
  within("instrument", static_cast<double>(task.instrument), 0,
         static_cast<double>(instruments) - 1);
  within("within_mm", task.within_mm, 0, 1e5);
  within("step_s", task.step_s, 1e-3, 1e3);
  within("longest_mm", task.longest_mm, 0, 1e6);
  within("largest_turn_rad", task.largest_turn_rad, 0, 1e6);
  within("force_limit_mN", task.force_limit_mN, 0, INFINITY);
  within("max_steps", task.max_steps, 1, INT_MAX);
  CheckRoute(task.route);
  return task;
}

std::vector<double> LengthsMm(const Scene& scene) {
  std::vector<double> lengths_mm;
  for (const InstrumentInfo& each : scene.instruments()) lengths_mm.push_back(each.max_length_mm);
  return lengths_mm;
}

}  // namespace

Navigation::Navigation(const Scene& scene, NavigationTask task)
    : task_(Checked(std::move(task), scene.instruments().size())),
      instruments_(scene.instruments().size()),
      lengths_mm_(LengthsMm(scene)),
      simulation_(scene),
      start_(simulation_) {
  memory_.route = task_.route;
  Conclude();
}

Navigation::Navigation(const Navigation& other) : Navigation(other, other.usage_.Look()) {}

Navigation::Navigation(const Navigation& other, const Usage<Error>::Hold& /*hold*/)
    : task_(other.task_),
      instruments_(other.instruments_),
      lengths_mm_(other.lengths_mm_),
      simulation_(other.simulation_),
      start_(other.start_),
      first_picture_(other.first_picture_),
      memory_(other.memory_) {}

NavigationState Navigation::Save() const {
  const auto hold = usage_.Look();
  return {.simulation = simulation_.Save(), .memory = memory_};
}

void Navigation::Load(const NavigationState& state, const std::function<void()>& after_tick) {
  const auto hold = usage_.Change();
  CheckRoute(state.memory.route);
  if (state.memory.nearest >= state.memory.route.size()) {
    throw Error("the saved environment is damaged; save it again");
  }
  simulation_ = Simulation::Load(start_.scene(), state.simulation, after_tick);
  memory_ = state.memory;
}

std::size_t Navigation::vector_size() const {
  return 3 * (kWirePoints + kRoutePoints + 1) + 3 * instruments_;
}

double Navigation::Force() const {
  for (const Reading& reading : simulation_.readings()) {
    if (reading.name == "wall_force_largest_mN") return reading.value;
  }
  throw Error("the scene does not measure wall force; add [effects.wall_force]");
}

void Navigation::FindOnRoute(std::size_t reach) {
  const std::size_t first = memory_.nearest > reach ? memory_.nearest - reach : 0;
  const std::size_t last = std::min(memory_.nearest + reach, memory_.route.size() - 1);
  double least_mm = INFINITY;
  for (std::size_t k = first; k <= last; ++k) {
    const double distance_mm = Distance(memory_.route[k], memory_.tip);
    if (distance_mm >= least_mm) continue;
    least_mm = distance_mm;
    memory_.nearest = k;
  }
  fact(Fact::kRemaining_mm) =
      static_cast<double>(memory_.route.size() - 1 - memory_.nearest) + least_mm;
}

// Sets the facts after a reset; a step adds to them.
void Navigation::Conclude() {
  memory_.facts = {};
  memory_.steps = 0;
  memory_.nearest = 0;
  memory_.tip = Tip();
  FindOnRoute(memory_.route.size());
  fact(Fact::kWallForce_mN) = Force();
  fact(Fact::kTime_s) = simulation_.time_s();
  memory_.worst_mN = 0;
  memory_.any_unknown = std::isnan(fact(Fact::kWallForce_mN));
}

// Mark of a step that reached the target: 0 or 1. NaN if no known force exceeded the limit, and one
// is not known.
double Navigation::SafeSuccess() const {
  if (memory_.worst_mN > task_.force_limit_mN) return 0;
  if (std::isinf(task_.force_limit_mN)) return 1;
  return memory_.any_unknown ? NAN : 1;
}

void Navigation::CheckStart(const NavigationStart& start) {
  RequireWithin<Error>("rotation_rad", start.rotation_rad, -1e4, 1e4);
  if (!start.route.empty()) CheckRoute(start.route);
}

void Navigation::CheckAction(const double* action) const {
  for (std::size_t k = 0; k < action_size(); ++k) {
    // Step clamps finite values to -1 .. 1; NaN and infinity are errors.
    RequireWithin<Error>("a value of the action", action[k], -kLargest, kLargest);
  }
}

void Navigation::Reset(const NavigationStart& start, const AfterTick& after_tick) {
  const auto hold = usage_.Change();
  CheckStart(start);
  simulation_ = start_;
  memory_.route = start.route.empty() ? task_.route : start.route;
  Command command = simulation_.command();
  command.time_s = task_.step_s;
  command.hands[task_.instrument].rotation_rad += start.rotation_rad;
  command.xray = task_.pictures;
  simulation_.Step(command, after_tick);
  Conclude();
  memory_.begun = true;
}

void Navigation::Step(const double* action, const AfterTick& after_tick) {
  const auto hold = usage_.Change();
  CheckAction(action);
  if (!memory_.begun) throw Error("the environment has not begun; call reset() before step()");
  if (fact(Fact::kTerminated) != 0 || fact(Fact::kTruncated) != 0) {
    throw Error("the episode has ended; call reset() before step()");
  }
  Command command = simulation_.command();
  command.time_s += task_.step_s;
  command.xray = task_.pictures;
  for (std::size_t k = 0; k < instruments_; ++k) {
    Hand& hand = command.hands[k];
    const double feed = std::clamp(action[2 * k], -1.0, 1.0);
    // A hand beyond the instrument's end would have to come back before the instrument moves.
    hand.insertion_mm =
        std::clamp(hand.insertion_mm + task_.longest_mm * feed, 0.0, lengths_mm_[k]);
    hand.rotation_rad += task_.largest_turn_rad * std::clamp(action[2 * k + 1], -1.0, 1.0);
  }
  simulation_.Step(command, after_tick);
  ++memory_.steps;
  const Point tip = Tip();
  const double before_mm = fact(Fact::kRemaining_mm);
  fact(Fact::kPath_mm) += Distance(tip, memory_.tip);
  memory_.tip = tip;
  FindOnRoute(kReach);
  const double force_mN = Force();
  memory_.worst_mN = std::fmax(memory_.worst_mN, force_mN);
  memory_.any_unknown = memory_.any_unknown || std::isnan(force_mN);
  const bool there = Distance(tip, memory_.route.back()) <= task_.within_mm;
  fact(Fact::kWallForce_mN) = force_mN;
  fact(Fact::kTerminated) = there;
  fact(Fact::kTruncated) = !there && memory_.steps >= task_.max_steps;
  fact(Fact::kSuccess) = there;
  fact(Fact::kSafeSuccess) = there ? SafeSuccess() : 0;
  fact(Fact::kTime_s) = simulation_.time_s();
  fact(Fact::kReward) = (before_mm - fact(Fact::kRemaining_mm)) / 10 - 0.01 + (there ? 10 : 0);
}

std::array<double, kFacts> Navigation::facts() const {
  const auto hold = usage_.Look();
  return memory_.facts;
}

void Navigation::Observe(float* out) const {
  const auto hold = usage_.Look();
  simulation_.WhileStill([&] { Write(out); });
}

void Navigation::Write(float* out) const {
  const auto put = [&out](const Point& point, const Point& from) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      *out++ = static_cast<float>(point[axis] - from[axis]);
    }
  };
  const std::vector<Point> nodes_mm = simulation_.InstrumentNodesMm(task_.instrument);
  const std::size_t count = nodes_mm.size();
  // With hardly any wire inside, the points are those at the entry. The last segment may be cut by
  // the tip.
  const double segment_mm = count > 2 ? std::max(Distance(nodes_mm[count - 1], nodes_mm[count - 2]),
                                                 Distance(nodes_mm[count - 2], nodes_mm[count - 3]))
                                      : kApart_mm;
  const auto every = static_cast<std::size_t>(std::max(1L, std::lround(kApart_mm / segment_mm)));
  for (std::size_t k = 1; k <= kWirePoints; ++k) {
    put(nodes_mm[count - 1 > k * every ? count - 1 - k * every : 0], memory_.tip);
  }
  for (std::size_t k = 1; k <= kRoutePoints; ++k) {
    const auto ahead = k * static_cast<std::size_t>(kApart_mm);
    put(memory_.route[std::min(memory_.route.size() - 1, memory_.nearest + ahead)], memory_.tip);
  }
  put(memory_.route.back(), memory_.tip);
  const std::vector<InstrumentState> all = simulation_.instruments();
  for (const InstrumentState& each : all) *out++ = static_cast<float>(each.hand.insertion_mm);
  for (const InstrumentState& each : all) {
    *out++ = static_cast<float>(std::cos(each.hand.rotation_rad));
  }
  for (const InstrumentState& each : all) {
    *out++ = static_cast<float>(std::sin(each.hand.rotation_rad));
  }
}

const Picture& Navigation::TakePicture() {
  const auto hold = usage_.Change();
  const Picture& last = simulation_.LastPicture();
  if (last.width > 0) return last;
  Simulation later = simulation_;
  Command command = later.command();
  command.time_s += 1e-3;
  command.xray = true;
  later.Step(command);
  first_picture_ = later.LastPicture();
  return first_picture_;
}

}  // namespace torquer::python
