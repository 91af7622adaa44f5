// bench-vessel measures vessels: opening a surface, building and looking up its field, and the
// field's accuracy.

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/support/machine.h"
#include "host/support/program.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer {
namespace {

using Eigen::Vector3d;
using vessel::BrickField;
using vessel::MeshVessel;

constexpr int kThreads = 2;

bool as_json = false;

void Record(const std::string& case_name, const std::string& metric, double value,
            const std::string& unit) {
  if (as_json) {
    const nlohmann::ordered_json row = {{"study", "vessel"},
                                        {"case", case_name},
                                        {"metric", metric},
                                        {"value", value},
                                        {"unit", unit}};
    std::cout << row.dump() << std::endl;
  } else {
    std::printf("%-28s %-22s %12.4g %s\n", case_name.c_str(), metric.c_str(), value, unit.c_str());
  }
}

double Milliseconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

// Measures the wall-clock time of `work` and the processor time of all threads.
template <typename Work>
void Time(const std::string& case_name, const std::string& metric, Work work) {
  const double wall = Milliseconds(CLOCK_MONOTONIC), cpu = Milliseconds(CLOCK_PROCESS_CPUTIME_ID);
  work();
  Record(case_name, metric + "_ms", Milliseconds(CLOCK_MONOTONIC) - wall, "ms");
  Record(case_name, metric + "_cpu_ms", Milliseconds(CLOCK_PROCESS_CPUTIME_ID) - cpu, "ms");
}

// Processor time of one call per point: the minimum over many rounds, because interruptions are no
// property of the code.
template <typename LookUp>
double NanosecondsEach(const std::vector<Vector3d>& points, LookUp look_up) {
  constexpr int kRounds = 60, kRepeats = 10;
  double least = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRounds; ++round) {
    const double start = Milliseconds(CLOCK_THREAD_CPUTIME_ID);
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      for (const Vector3d& point : points) look_up(point);
    }
    least = std::min(least, Milliseconds(CLOCK_THREAD_CPUTIME_ID) - start);
  }
  return least * 1e6 / kRepeats / static_cast<double>(points.size());
}

// Nodes of a wire along a curve, off its center.
std::vector<Vector3d> AlongWire(const vessel::Centerline& curve, int count) {
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const vessel::CenterlineSample at = curve.At(250.0 * i / count);
    const Vector3d side = at.tangent.cross(Vector3d::UnitZ()).normalized();
    points.emplace_back(at.position_mm + 0.5 * side);
  }
  return points;
}

volatile double sink = 0;

template <typename Field>
void TimeLookUps(const std::string& case_name, const Field& field,
                 const vessel::Centerline& curve) {
  for (const int count : {250, 2500}) {
    const std::vector<Vector3d> points = AlongWire(curve, count);
    const std::string name = case_name + "/n=" + std::to_string(count);
    ClearanceSample sample;
    double sum = 0;
    Record(name, "value_ns",
           NanosecondsEach(points, [&](const Vector3d& p) { sum += field.Clearance(p); }), "ns");
    Record(name, "gradient_ns",
           NanosecondsEach(points,
                           [&](const Vector3d& p) {
                             field.EvaluateGradient(p, sample);
                             sum += sample.clearance_mm + sample.gradient.sum();
                           }),
           "ns");
    Record(name, "hessian_ns",
           NanosecondsEach(points,
                           [&](const Vector3d& p) {
                             field.EvaluateHessian(p, sample);
                             sum +=
                                 sample.clearance_mm + sample.gradient.sum() + sample.hessian.sum();
                           }),
           "ns");
    sink = sum;
  }
}

// Measures the field's error within 0.75 mm of the wall, at points unrelated to the mesh.
void MeasureAccuracy(const std::string& case_name, const MeshVessel& vessel) {
  const vessel::TriangleMesh& mesh = vessel.mesh();
  std::vector<double> errors;
  double steepest = 0;
  for (int i = 0; i < 20000; ++i) {
    const size_t triangle = static_cast<size_t>(i) * 7919 % mesh.triangles.size();
    const double golden = 0.6180339887498949 * i, silver = 0.4142135623730951 * i;
    double a = golden - std::floor(golden), b = silver - std::floor(silver);
    const double height = 0.75 * std::sin(1.7 * i);
    if (a + b > 1) {
      a = 1 - a;
      b = 1 - b;
    }
    const Vector3d p = (1 - a - b) * mesh.Corner(triangle, 0) + a * mesh.Corner(triangle, 1) +
                       b * mesh.Corner(triangle, 2) +
                       height * mesh.DoubleArea(triangle).normalized();
    ClearanceSample sample;
    vessel.field().LookGradient(p, sample);
    errors.push_back(1e3 * std::abs(sample.clearance_mm - vessel.surface().Distance(p)));
    steepest = std::max(steepest, sample.gradient.norm());
  }
  std::sort(errors.begin(), errors.end());
  Record(case_name, "error_um_p50", errors[errors.size() / 2], "um");
  Record(case_name, "error_um_p99", errors[errors.size() * 99 / 100], "um");
  Record(case_name, "error_um_max", errors.back(), "um");
  Record(case_name, "steepest", steepest, "");
}

void Surface(const std::string& name, const std::string& file, vessel::MeshUnit unit,
             const std::string& centerlines, const std::string& scratch) {
  for (const double voxel_mm : {0.5, 0.25}) {
    const std::string case_name = name + (voxel_mm == 0.5 ? "/voxel=0.5" : "/voxel=0.25");
    const std::string path = torquer::test::SourcePath("/host/scenes/meshes/") + file;
    vessel::MeshVesselOptions options;
    options.unit = unit;
    options.field.voxel_mm = voxel_mm;
    options.cache_folder = scratch;
    std::unique_ptr<MeshVessel> opened;
    Time(case_name, "cold_usable", [&] {
      opened = MeshVessel::Open(path, options);
      opened->field().Build(1, kThreads);
    });
    MeasureAccuracy(case_name, *opened);
    const size_t before = opened->field().Statistics().bricks[0];
    Record(case_name, "bricks_looked_at", static_cast<double>(before), "");
    Time(case_name, "build_all", [&] { opened->field().Build(0, kThreads); });
    const vessel::BrickFieldStatistics built = opened->field().Statistics();
    Record(case_name, "bricks", static_cast<double>(built.bricks[0]), "");
    Record(case_name, "brick_memory_MB", static_cast<double>(built.brick_bytes) / 1e6, "MB");
    Time(case_name, "save_cache", [&] {
      const std::string why = opened->SaveCache();
      if (!why.empty()) throw UserError(why);
    });
    std::unique_ptr<MeshVessel> cached;
    Time(case_name, "cached_usable", [&] {
      cached = MeshVessel::Open(path, options);
      cached->field().Build(1, kThreads);
    });
    if (centerlines.empty()) continue;
    const vessel::CenterlineNetwork network = vessel::ParseSlicerCurves(
        vessel::ReadCurveFiles(torquer::test::SourcePath("/host/scenes/meshes/") + centerlines));
    const vessel::Centerline way =
        network.Path(network.Place("curve_07", "start"), network.Place("rcca", "end"));
    TimeLookUps(case_name, cached->field(), way);
  }
}

// Measures the union of a fine vessel with a branch that ends in its lumen.
void Union() {
  constexpr int kFine = 100;
  vessel::TriangleMesh both = vessel::MakeTubeMesh(40, kFine, kFine, [](double) { return 3.0; });
  vessel::TriangleMesh branch = vessel::MakeTubeMesh(30, kFine, kFine, [](double) { return 2.0; });
  for (Vector3d& v : branch.vertices_mm) v = Vector3d(20.3 - v.y(), 0.2 + v.x(), v.z());
  vessel::Append(both, branch);
  const std::string case_name = "union/triangles=" + std::to_string(both.triangles.size());
  vessel::SurfaceMesh joined;
  Time(case_name, "repair", [&] { joined = vessel::RepairSurface(both, "tubes"); });
  Record(case_name, "left_out_mm2", joined.report.left_out_mm2, "mm^2");
}

void Phantom() {
  const vessel::TubeVessel phantom = vessel::MakeTyPhantom();
  const vessel::Centerline& main = phantom.centerlines.curves()[0];
  TimeLookUps("ty_phantom/analytic", *phantom.field, main);
  const auto baked = BrickField::FromFunction(
      [&](const Vector3d& p) { return phantom.field->Clearance(p); }, phantom.bounds_mm);
  TimeLookUps("ty_phantom/baked", *baked, main);
}

}  // namespace
}  // namespace torquer

int main(int argc, char** argv) {
  torquer::Program program("bench-vessel",
                           "Measures what vessels cost: opening a surface, building its field, "
                           "looking it up; and how near the field is.");
  program.options().Flag("--json", torquer::as_json,
                         "print one JSON object a line: study, case, metric, value, unit");
  return program.Main(argc, argv, [] {
    std::cerr << torquer::DescribeMachine() << "\n";
    const torquer::test::TemporaryFolder scratch;
    torquer::Phantom();
    torquer::Union();
    torquer::Surface("neuro_arch", "neuro_arch/surface.obj", torquer::vessel::MeshUnit::kMillimeter,
                     "neuro_arch/centerlines", scratch.Path());
    torquer::Surface("abdominal_aorta", "abdominal_aorta/surface.stl",
                     torquer::vessel::MeshUnit::kMeter, "", scratch.Path());
    return static_cast<int>(torquer::kExitSuccess);
  });
}
