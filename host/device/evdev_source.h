// Reports made from an ordinary mouse and an optional joystick: a bench without soldering. The
// mouse senses the cylinder, with its x axis along the wire (positive distally) and its y axis
// around it. Its left, right, middle and side button, or the first four of the joystick, are X-ray,
// contrast, clutch and stick.
//
// Both are grabbed, so that they do not move the pointer. Their raw deltas are read, without the
// acceleration of the desktop. Every event of the mouse makes a report; without events there is one
// every millisecond. The kernel's time stamps are the device clock.
#pragma once

#include <libevdev/libevdev.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "host/device/reopening.h"
#include "host/device/report_source.h"
#include "host/device/wake_up.h"
#include "protocol/hid_reports.h"

namespace torquer::device {

/// Assumed resolution of a mouse, counts per inch, as most have.
inline constexpr int kNominalMouseCpi = 1000;

/// A mouse or joystick of this machine.
struct InputListing {
  std::string path;
  std::string name;
  std::string serial;  ///< its own number, or vendor:product
  bool is_mouse = false;
};

/// Input devices that this user may read, by names that stay after a replug if such names exist.
std::vector<InputListing> InputsHere();

class EvdevSource : public ReportSource {
 public:
  /// `paths`: device files of the mouse and of an optional joystick, in any order. They may appear
  /// later. Without a path, or with more than two, throws UserError that names the mice of this
  /// machine.
  explicit EvdevSource(std::vector<std::string> paths);
  ~EvdevSource() override;
  EvdevSource(const EvdevSource&) = delete;
  EvdevSource& operator=(const EvdevSource&) = delete;

  /// Before the first connection it throws UserError for a file that may not be read, or is given
  /// twice. It also throws for a device that is neither mouse nor joystick, or is grabbed by
  /// another program.
  void Wait(int timeout_ms, const Sink& sink) override;
  void LetGo(const std::string& reason) override;
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
  Reopening reopening_;
  int timer_ = -1;
  std::vector<std::unique_ptr<Input>> inputs_;  // while connected; the mouse first
  std::string gone_;                            // why, once one of them is
  std::string serial_;
  protocol::InputReport report_{};  // the state for the next report
  std::int64_t last_time_us_ = 0;
  bool doubtful_ = false;  // events were dropped since the last report
};

}  // namespace torquer::device
