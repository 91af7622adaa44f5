// The host at the other end of the bus: frames, enumeration, control transfers, polling.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "host/emulator/bench_device.h"

namespace torquer::emulator {

/// bmRequestType .. wLength.
struct SetupPacket {
  std::uint8_t type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;
};

enum class TransferStatus { kDone, kStall, kTimeout, kGone };

/// 0, or a negative errno, as from the kernel.
int StatusOf(TransferStatus status);

struct ControlResult {
  TransferStatus status = TransferStatus::kGone;
  std::vector<std::uint8_t> data;  ///< bytes that the device sent
};

/// Descriptors and strings that the device reported at enumeration.
struct Enumeration {
  std::vector<std::uint8_t> device_descriptor;
  std::vector<std::uint8_t> configuration_descriptor;
  std::vector<std::uint8_t> report_descriptor;
  std::string manufacturer, product, serial;
};

class UsbHost {
 public:
  using ControlCallback = std::function<void(const ControlResult&)>;

  explicit UsbHost(BenchDevice& device) : device_(device) {}

  /// True if the host wants the next input packet; asked once a frame while the device is
  /// configured. A host that does not want one does not poll, and the device keeps its report.
  std::function<bool()> wants_input = [] { return false; };
  /// An input packet, in the frame after the one in which the device queued it.
  std::function<void(const std::vector<std::uint8_t>&)> on_input;
  /// The endpoint is halted.
  std::function<void()> on_input_stall;
  /// The device is enumerated and configured; it has left the bus.
  std::function<void()> on_ready;
  std::function<void()> on_gone;

  /// Lets one frame of 1 ms pass: start of frame, poll, control transfers.
  void RunFrame();
  /// Until the device is ready; false after `frames`.
  bool RunUntilReady(int frames = 2000);

  /// Queues a control transfer; `callback` is called from RunFrame(). `data` is what goes to the
  /// device.
  void Submit(const SetupPacket& setup, std::vector<std::uint8_t> data, ControlCallback callback);
  /// The same, with frames passing until it is over.
  ControlResult Control(const SetupPacket& setup, const std::vector<std::uint8_t>& data = {});

  /// HID requests for feature reports; the first byte sent is the id.
  void SubmitGetFeature(std::uint8_t report_id, ControlCallback callback);
  void SubmitSetFeature(std::vector<std::uint8_t> report, ControlCallback callback);
  ControlResult GetFeature(std::uint8_t report_id);
  ControlResult SetFeature(const std::vector<std::uint8_t>& report);

  /// Resets the port; the device is enumerated again.
  void ResetPort();

  /// Leaves the bus idle from now on, like a computer that goes to sleep. The device can end that
  /// if it was allowed to wake the host.
  void Suspend();
  /// Signals resume for 20 ms and continues.
  void Resume();
  bool suspended() const { return suspended_; }

  bool ready() const { return state_ == State::kReady; }
  const Enumeration& enumeration() const { return enumeration_; }
  /// Packets that the device handed over on the input endpoint.
  std::int64_t inputs_received() const { return inputs_received_; }
  /// Times that a packet came with the data toggle of the one before.
  std::int64_t toggle_errors() const { return toggle_errors_; }

 private:
  enum class State { kDetached, kDebouncing, kResetting, kEnumerating, kReady };
  enum class Stage { kSetup, kData, kStatus };
  struct Transfer {
    SetupPacket setup;
    std::vector<std::uint8_t> data;
    ControlCallback callback;
    Stage stage = Stage::kSetup;
    std::size_t sent = 0;
    int age_frames = 0;
  };

  void FollowPort();
  void DriveBus();
  bool Converses() const;
  void Enumerate();
  void Poll();
  void StepTransfer();
  void Finish(TransferStatus status);
  void LoseDevice();

  BenchDevice& device_;
  State state_ = State::kDetached;
  Enumeration enumeration_;
  std::deque<Transfer> transfers_;
  unsigned frame_ = 0;
  int wait_frames_ = 0;
  bool suspended_ = false;
  int resume_frames_ = 0;  // of the resume signal and the quiet after it, to come
  std::uint8_t address_ = 0;
  std::uint8_t next_address_ = 1;
  std::size_t control_packet_ = 8;
  bool expected_toggle_ = false;
  std::int64_t inputs_received_ = 0;
  std::int64_t toggle_errors_ = 0;
};

}  // namespace torquer::emulator
