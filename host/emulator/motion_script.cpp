#include "host/emulator/motion_script.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::emulator {
namespace {

constexpr char kHeader[] = "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons";

std::vector<std::string> Split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::stringstream stream(line);
  std::string part;
  while (std::getline(stream, part, separator)) parts.push_back(part);
  if (!line.empty() && line.back() == separator) parts.emplace_back();
  return parts;
}

class RowReader {
 public:
  RowReader(const std::string& name, int line) : where_(name + ":" + std::to_string(line)) {}

  [[noreturn]] void Fail(const std::string& what) const { throw UserError(where_ + ": " + what); }

  double Number(const std::string& field, const std::string& text) const {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0' || !std::isfinite(value)) {
      Fail(field + " is `" + text + "`, which is no finite number.");
    }
    return value;
  }

  double Deflection(const std::string& field, const std::string& text) const {
    const double value = Number(field, text);
    if (value < -1 || value > 1) {
      Fail(field + " is " + text + "; a joystick deflects from -1 to 1.");
    }
    return value;
  }

  std::uint8_t Buttons(const std::string& text) const {
    std::uint8_t buttons = 0;
    if (text.empty() || text == "none") return buttons;
    for (const std::string& name : Split(text, '+')) {
      if (name == "xray") {
        buttons |= protocol::kButtonXray;
      } else if (name == "contrast") {
        buttons |= protocol::kButtonContrast;
      } else if (name == "clutch") {
        buttons |= protocol::kButtonClutch;
      } else {
        Fail("button `" + name + "` is unknown; use xray, contrast, clutch, joined by +, or none.");
      }
    }
    return buttons;
  }

 private:
  std::string where_;
};

}  // namespace

MotionScript MotionScript::FromFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw UserError(path + ": cannot open the motion file. Check the path.");
  return FromStream(file, path);
}

MotionScript MotionScript::FromStream(std::istream& stream, const std::string& name) {
  MotionScript script;
  std::string line;
  int number = 0;
  while (std::getline(stream, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const RowReader reader(name, number);
    if (number == 1) {
      if (line != kHeader) {
        reader.Fail("the header is `" + line + "`; it must be `" + kHeader + "`.");
      }
      continue;
    }
    if (line.empty()) continue;
    const std::vector<std::string> fields = Split(line, ',');
    if (fields.size() != 6) {
      reader.Fail("has " + std::to_string(fields.size()) + " fields where the header names 6.");
    }
    Row row;
    row.time_s = reader.Number("time_s", fields[0]);
    row.hand.insertion_mm = reader.Number("insertion_mm", fields[1]);
    row.hand.rotation_rad = reader.Number("rotation_rad", fields[2]);
    row.hand.joystick_x = reader.Deflection("joystick_x", fields[3]);
    row.hand.joystick_y = reader.Deflection("joystick_y", fields[4]);
    row.hand.buttons = reader.Buttons(fields[5]);
    if (row.time_s < 0) reader.Fail("time_s is " + fields[0] + "; times begin at 0.");
    if (!script.rows_.empty() && row.time_s <= script.rows_.back().time_s) {
      reader.Fail("time_s is " + fields[0] + ", not later than the row before; sort the rows.");
    }
    script.rows_.push_back(row);
  }
  if (number == 0) {
    throw UserError(name + ":1: the file is empty; it must begin with `" + kHeader + "`.");
  }
  if (script.rows_.empty())
    throw UserError(name + ": no rows after the header; give at least one.");
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
  hand.joystick_x += share * (after->hand.joystick_x - hand.joystick_x);
  hand.joystick_y += share * (after->hand.joystick_y - hand.joystick_y);
  return hand;
}

}  // namespace torquer::emulator
