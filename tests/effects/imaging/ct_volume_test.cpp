// Scans from files, and the attenuation of their values.
#include "host/simulator/effects/imaging/ct_volume.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <string>
#include <utility>

#include "host/simulator/effects/imaging/ct_attenuation.h"
#include "host/support/error.h"
#include "tests/support/ct_phantom.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using Eigen::Vector3d;
using torquer::UserError;
using torquer::effects::CtAttenuation;
using torquer::effects::CtVolume;
using torquer::effects::ReadCtVolume;
using torquer::test::BytesOf;
using torquer::test::MetaHeader;
using torquer::test::ScanOf;
using torquer::test::TemporaryFolder;

namespace {

CtVolume SmallScan() {
  return ScanOf({4, 3, 2}, 1, {5, -7, 11}, [](const Vector3d& at) { return 100 * at[0] + at[2]; });
}

std::string WithField(std::string header, const std::string& from, const std::string& to) {
  const std::size_t at = header.find(from);
  REQUIRE(at != std::string::npos);
  return header.replace(at, from.size(), to);
}

std::string RefusalOf(const std::string& contents) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("scan.mha");
  std::ofstream(path, std::ios::binary) << contents;
  try {
    ReadCtVolume(path, {});
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("A MetaImage has its values and its place in the patient", "[effects]") {
  const TemporaryFolder folder;
  const CtVolume scan = SmallScan();
  // Columns run along +y, rows along -x, slices upwards.
  std::string header = WithField(MetaHeader(scan), "1 0 0 0 1 0 0 0 1", "0 1 0 -1 0 0 0 0 1");
  header = WithField(header, "ElementSpacing = 1 1 1", "ElementSpacing = 0.5 0.7 1.25");
  std::ofstream(folder.Path("scan.mha"), std::ios::binary) << header << BytesOf(scan);
  const CtVolume read = ReadCtVolume(folder.Path("scan.mha"), {});
  CHECK(read.size == scan.size);
  CHECK(read.values == scan.values);
  CHECK(read.first_mm == Vector3d(5, -7, 11));
  CHECK((read.step_mm.col(0) - Vector3d(0, 0.5, 0)).norm() < 1e-12);
  CHECK((read.step_mm.col(1) - Vector3d(-0.7, 0, 0)).norm() < 1e-12);
  CHECK((read.step_mm.col(2) - Vector3d(0, 0, 1.25)).norm() < 1e-12);
  // A vessel whose file is in RAS: left is -x there, and posterior -y.
  const torquer::vessel::PatientAxes ras{{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}};
  const CtVolume in_ras = ReadCtVolume(folder.Path("scan.mha"), ras);
  CHECK(in_ras.first_mm == Vector3d(-5, 7, 11));
  CHECK((in_ras.step_mm.col(0) - Vector3d(0, -0.5, 0)).norm() < 1e-12);
}

TEST_CASE("A file that is not such a scan is refused with its field", "[effects]") {
  const CtVolume scan = SmallScan();
  const std::string header = MetaHeader(scan);
  const std::string bytes = BytesOf(scan);
  REQUIRE(RefusalOf(header + bytes).empty());
  const std::pair<const char*, const char*> faults[] = {
      {"NDims = 3", "NDims = 2"},
      {"MET_SHORT", "MET_FLOAT"},
      {"LOCAL", "scan.raw"},
      {"CompressedData = False", "CompressedData = True"},
      {"MSB = False", "MSB = True"},
      {"DimSize = 4 3 2", "DimSize = 4 3"},
      {"DimSize = 4 3 2", "DimSize = 4 3 1"},
      {"DimSize = 4 3 2", "DimSize = 4 3 99999999999"},
      {"DimSize = 4 3 2", "DimSize = 8000 8000 8000"},
      {"ElementSpacing = 1 1 1", "ElementSpacing = 1 1 nan"},
      {"ElementSpacing = 1 1 1", "ElementSpacing = 0.001 0.001 0.001"},
      {"Offset = 5 -7 11", "Offset = 5 -7 inf"},
      {"0 1 0 0 0 1", "0 1 0 0 1 0"},
      {"1 0 0 0 1", "2 0 0 0 1"},
      {"ObjectType = Image", "Position = 0 0 0"},
  };
  for (const auto& [from, to] : faults) {
    INFO(to);
    const std::string refusal = RefusalOf(WithField(header, from, to) + bytes);
    CHECK_THAT(refusal, Contains("scan.mha: field ") && Contains("torquer-import"));
  }
  CHECK_THAT(RefusalOf(WithField(header, "Offset", "Other") + bytes),
             Contains("field Offset is missing"));
  CHECK_THAT(RefusalOf(header + bytes.substr(2)), Contains("copy it again"));
  CHECK_THAT(RefusalOf(header + bytes + "xx"), Contains("copy it again"));
  CHECK_THAT(RefusalOf("solid model\n"), Contains("does not begin as a MetaImage"));
  CHECK_THAT(RefusalOf(std::string(100000, 'x')), Contains("ElementDataFile"));
  CHECK_THAT(RefusalOf(""), Contains("ElementDataFile"));
}

// xraylib 4.0 computed the expected values from published fractions by weight. The bone is that of
// ICRP, with 1445 HU in a CT of 70 keV. The code has that of ICRU-44.
TEST_CASE("Tissues attenuate as published from their values in a CT", "[effects]") {
  struct Tissue {
    double hu;  // at 70 keV
    double keV;
    double expected_1_mm;
    double tolerance;
  };
  const Tissue tissues[] = {
      {0, 42.5, 0.025467, 0.003},   {0, 60, 0.020590, 0.001},      {0, 72.5, 0.019032, 0.001},
      {0, 100, 0.017070, 0.002},    {1444.6, 50, 0.07674, 0.005},  {1444.6, 60, 0.05739, 0.005},
      {1444.6, 80, 0.04108, 0.005}, {1444.6, 100, 0.03441, 0.005}, {53.0, 50, 0.023997, 0.006},
      {53.0, 60, 0.021714, 0.003},  {53.0, 80, 0.019325, 0.002},   {56.0, 50, 0.024146, 0.01},
      {56.0, 60, 0.021802, 0.005},  {-76.6, 60, 0.018751, 0.02},   {-76.6, 80, 0.017103, 0.01},
  };
  for (const Tissue& tissue : tissues) {
    INFO(tissue.hu << " HU at " << tissue.keV << " keV");
    CHECK(CtAttenuation(tissue.keV, 70).Of(tissue.hu) ==
          Approx(tissue.expected_1_mm).epsilon(tissue.tolerance));
  }
  CHECK(CtAttenuation(60, 70).Of(-1000) == 0);
  CHECK(CtAttenuation(60, 70).Of(-3024) == 0);  // filled in beyond the scan's circle
}
