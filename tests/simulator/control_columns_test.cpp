// Columns of a script that set the X-ray system, the table and the injections.
#include "host/api/control_columns.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "host/api/row_run.h"
#include "host/api/script_columns.h"
#include "host/simulator/program/script_run.h"
#include "host/support/csv_table.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::test::SceneFile;

namespace {

// Rows of a script for the guidewire of SceneFile.
std::vector<torquer::ScriptRow> RowsOf(const SceneFile& file, const std::string& text) {
  const std::string path = file.Beside("controls.csv");
  std::ofstream(path) << text;
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  return torquer::ReadScript(path, file.path(), scene.instruments());
}

}  // namespace

TEST_CASE("A script sets all controls of a command", "[simulator]") {
  const SceneFile file;
  const auto rows =
      RowsOf(file,
             "time_s,lao_deg,cra_deg,xray,contrast,table_left_mm,table_head_mm,table_height_mm,"
             "imaging_mode,pulses_per_s,magnification,shutter_left,shutter_right,shutter_top,"
             "shutter_bottom,wedge_left,wedge_left_deg,wedge_right,wedge_right_deg,injector,"
             "injector_volume_mL,injector_rate_mL_s,injector_delay_s,injector_rise_s\n"
             "0,1,2,1,0,3,4,5,cine,7.5,2,0.1,0.2,0.3,0.4,0.15,-10,0.25,20,inject,12,3,0.5,0.25\n"
             "1,0,0,0,1,0,0,0,as_scene,0,1,0,0,0,0,0,0,0,0,off,-1,-1,-1,-1\n");
  REQUIRE(rows.size() == 2);
  const torquer::Command& all = rows[0].command;
  CHECK(all.lao_deg == 1);
  CHECK(all.cra_deg == 2);
  CHECK(all.xray);
  CHECK_FALSE(all.contrast);
  CHECK(all.table.left_mm == 3);
  CHECK(all.table.head_mm == 4);
  CHECK(all.table.height_mm == 5);
  const torquer::Imaging& imaging = all.imaging;
  CHECK(imaging.mode == torquer::Imaging::Mode::kCine);
  CHECK(imaging.pulses_per_s == 7.5);
  CHECK(imaging.magnification == 2);
  CHECK(std::vector{imaging.left, imaging.right, imaging.top, imaging.bottom} ==
        std::vector{0.1, 0.2, 0.3, 0.4});
  CHECK(imaging.wedge_left.share == 0.15);
  CHECK(imaging.wedge_left.rotation_deg == -10);
  CHECK(imaging.wedge_right.share == 0.25);
  CHECK(imaging.wedge_right.rotation_deg == 20);
  CHECK(all.injector.order == torquer::Injector::Order::kInject);
  CHECK(all.injector.volume_mL == 12);
  CHECK(all.injector.rate_mL_s == 3);
  CHECK(all.injector.delay_s == 0.5);
  CHECK(all.injector.rise_s == 0.25);
  // Without these columns, and with the scene's values, a command has its defaults.
  const auto defaults = [](const torquer::Command& command) {
    const torquer::effects::Controls controls = torquer::ToControls(command);
    return controls.imaging == torquer::effects::Imaging() && !controls.xray &&
           controls.table == torquer::effects::Table() &&
           controls.injector == torquer::effects::Injector();
  };
  CHECK(defaults(rows[1].command));
  CHECK(defaults(RowsOf(file, "time_s\n0\n")[0].command));
}

TEST_CASE("A value that a control cannot have is refused with its column and its values",
          "[simulator]") {
  const SceneFile file;
  std::set<std::string> names;
  for (const torquer::ControlColumn& column : torquer::ControlColumns()) {
    CHECK(names.insert(column.name).second);
    for (const char* cell : {"1e9", "-7000", "nonsense"}) {
      INFO(column.name << ' ' << cell);
      CHECK_THROWS_WITH(RowsOf(file, std::string("time_s,") + column.name + "\n0," + cell + '\n'),
                        Contains("controls.csv:2: " + std::string(column.name) + " is '" + cell));
    }
  }
  const auto refused = [&](const std::string& column, const std::string& cell,
                           const std::string& remedy) {
    CHECK_THROWS_WITH(RowsOf(file, "time_s," + column + "\n0," + cell + '\n'), Contains(remedy));
  };
  refused("xray", "0.5", "give 0 or 1");
  refused("imaging_mode", "2", "give as_scene, plain, subtraction, roadmap, cine");
  refused("pulses_per_s", "0.5", "give 1 to 60, or 0 for the scene's value");
  refused("injector", "fire", "give off, arm, inject");
  refused("injector_volume_mL", "0", "give 0.1 to 150, or -1 for the scene's value");
  refused("shutter_top", "0.46", "give 0 to 0.45");
}
