#include "host/emulator/motion_script.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "host/support/csv_table.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::emulator {
namespace {

constexpr char kHeader[] = "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons";
constexpr char kTwoHeader[] =
    "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons,"
    "catheter_insertion_mm,catheter_rotation_rad";
enum Column : std::size_t {
  kTime,
  kInsertion,
  kRotation,
  kJoystickX,
  kJoystickY,
  kButtons,
  kCatheterInsertion,
  kCatheterRotation
};

class RowReader {
 public:
  RowReader(const std::string& path, const CsvRow& row) : path_(path), row_(row) {}

  [[noreturn]] void Fail(const std::string& what) const {
    throw UserError(path_ + ":" + std::to_string(row_.line) + ": " + what);
  }

  double Number(Column column) const { return CsvNumber(path_, kTwoHeader, row_, column); }
  bool has_catheter() const { return row_.cells.size() > kCatheterInsertion; }

  double Deflection(Column column, const char* name) const {
    const double value = Number(column);
    if (value < -1 || value > 1) {
      Fail(std::string(name) + " is " + row_.cells[column] + "; a joystick deflects from -1 to 1");
    }
    return value;
  }

  std::uint8_t Buttons() const {
    const std::string& text = row_.cells[kButtons];
    std::uint8_t buttons = 0;
    if (text.empty() || text == "none") return buttons;
    std::stringstream stream(text);
    std::string name;
    while (std::getline(stream, name, '+')) {
      if (name == "xray") {
        buttons |= protocol::kButtonXray;
      } else if (name == "contrast") {
        buttons |= protocol::kButtonContrast;
      } else if (name == "clutch") {
        buttons |= protocol::kButtonClutch;
      } else if (name == "stick") {
        buttons |= protocol::kButtonStick;
      } else {
        Fail("button '" + name +
             "' is unknown; give xray, contrast, clutch, stick, several joined by +, or none");
      }
    }
    return buttons;
  }

 private:
  const std::string& path_;
  const CsvRow& row_;
};

// Rows of a file with either header.
std::vector<CsvRow> RowsOf(const std::string& path) {
  CsvTable table = ReadCsvTable(path);
  std::string header;
  for (const std::string& column : table.columns) header += (header.empty() ? "" : ",") + column;
  if (header == kTwoHeader || header == kHeader) return std::move(table.rows);
  return ReadCsv(path, kHeader);  // refuses the header
}

}  // namespace

MotionScript MotionScript::FromFile(const std::string& path) {
  MotionScript script;
  for (const CsvRow& cells : RowsOf(path)) {
    const RowReader reader(path, cells);
    Row row;
    row.time_s = reader.Number(kTime);
    row.hand.insertion_mm = reader.Number(kInsertion);
    row.hand.rotation_rad = reader.Number(kRotation);
    row.hand.joystick_x = reader.Deflection(kJoystickX, "joystick_x");
    row.hand.joystick_y = reader.Deflection(kJoystickY, "joystick_y");
    row.hand.buttons = reader.Buttons();
    if (reader.has_catheter()) {
      row.hand.catheter_insertion_mm = reader.Number(kCatheterInsertion);
      row.hand.catheter_rotation_rad = reader.Number(kCatheterRotation);
    }
    if (row.time_s < 0) reader.Fail("time_s is " + cells.cells[kTime] + "; times begin at 0");
    if (!script.rows_.empty() && row.time_s <= script.rows_.back().time_s) {
      reader.Fail("time_s is " + cells.cells[kTime] +
                  ", which is not later than in the row before; sort the rows by time");
    }
    script.rows_.push_back(row);
  }
  if (script.rows_.empty()) {
    throw UserError(path + ":1: no rows after the header; give at least one");
  }
  return script;
}

HandState MotionScript::At(double time_s) const {
  if (rows_.empty()) return {};
  const auto after =
      std::upper_bound(rows_.begin(), rows_.end(), time_s,
                       [](double time, const Row& row) { return time < row.time_s; });
  if (after == rows_.begin()) return rows_.front().hand;
  const Row& from = *(after - 1);
  if (after == rows_.end()) return from.hand;
  const double share = (time_s - from.time_s) / (after->time_s - from.time_s);
  HandState hand = from.hand;
  hand.insertion_mm += share * (after->hand.insertion_mm - hand.insertion_mm);
  hand.rotation_rad += share * (after->hand.rotation_rad - hand.rotation_rad);
  hand.catheter_insertion_mm +=
      share * (after->hand.catheter_insertion_mm - hand.catheter_insertion_mm);
  hand.catheter_rotation_rad +=
      share * (after->hand.catheter_rotation_rad - hand.catheter_rotation_rad);
  hand.joystick_x += share * (after->hand.joystick_x - hand.joystick_x);
  hand.joystick_y += share * (after->hand.joystick_y - hand.joystick_y);
  return hand;
}

}  // namespace torquer::emulator
