// Reports made of an ordinary mouse, and of a joystick where there is one: the way in without any
// soldering. The mouse looks at the cylinder, its x axis along the wire (positive distally) and its
// y axis around it; its left, right and middle button, or the joystick's first three, are X-ray,
// contrast and clutch.
//
// Both are grabbed, so that they move no pointer, and read as raw deltas, to which the desktop's
// acceleration is never applied. A report is made of every event of the mouse, and of none once a
// millisecond, with the kernel's time stamps as the device clock.
#pragma once

#include <libevdev/libevdev.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "host/device/report_source.h"
#include "host/device/wake_up.h"
#include "protocol/hid_reports.h"

namespace torquer::device {

/// What a mouse is taken for without a calibration, counts an inch; most are set to about this.
inline constexpr int kNominalMouseCpi = 1000;

/// A mouse or joystick of this machine.
struct InputListing {
  std::string path;
  std::string name;
  std::string serial;  ///< its own number, or vendor:product
  bool is_mouse = false;
};

/// Those that this user may read, by names that outlast a replug if possible.
std::vector<InputListing> InputsHere();

class EvdevSource : public ReportSource {
 public:
  /// `paths`: the mouse's device file and, if there is one, the joystick's, in any order. They need
  /// not be there yet. Throws UserError, naming the mice found, when none is given or too many are.
  explicit EvdevSource(std::vector<std::string> paths);
  ~EvdevSource() override;
  EvdevSource(const EvdevSource&) = delete;
  EvdevSource& operator=(const EvdevSource&) = delete;

  /// Also throws UserError when a file may not be read, is neither mouse nor joystick, is there
  /// twice, or is grabbed by another program.
  void Wait(int timeout_ms, const Sink& sink) override;
  void Interrupt() override { wake_up_.Raise(); }

  /// Identity and configuration, as a bench device would give them.
  std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) override;
  void SetFeature(std::span<const std::uint8_t> report) override;
  std::string place() const override;

 private:
  struct Input;

  bool Open();
  void Close();
  void ReadAll(Input& input, std::deque<protocol::InputReport>& reports);
  void NoteGone(const Input& input);
  void Take(Input& input, const input_event& event, std::deque<protocol::InputReport>& reports);
  protocol::InputReport MakeReport(std::int64_t time_us);

  std::vector<std::string> paths_;
  WakeUp wake_up_;
  int timer_ = -1;
  std::vector<std::unique_ptr<Input>> inputs_;  // while connected; the mouse first
  std::string gone_;                            // why, once one of them is
  std::string serial_;
  protocol::InputReport report_{};  // the state that the next report tells
  std::int64_t last_time_us_ = 0;
  bool doubtful_ = false;  // events were dropped since the last report
};

}  // namespace torquer::device
