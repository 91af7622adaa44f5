#include "host/emulator/usb_host.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

namespace torquer::emulator {

int StatusOf(TransferStatus status) {
  switch (status) {
    case TransferStatus::kDone:
      return 0;
    case TransferStatus::kStall:
      return -EPIPE;
    case TransferStatus::kTimeout:
      return -ETIMEDOUT;
    case TransferStatus::kGone:
      break;
  }
  return -ENODEV;
}
namespace {

constexpr int kDebounceFrames = 100;       // USB 2.0, 7.1.7.3
constexpr int kResetFrames = 10;           // tDRST
constexpr int kResetRecoveryFrames = 10;   // tRSTRCY
constexpr int kResumeFrames = 20;          // tDRSMDN
constexpr int kResumeRecoveryFrames = 10;  // tRSMRCY
constexpr int kTransferFrames = 1000;      // hosts give up after seconds
constexpr int kSlotsAFrame = 20;

constexpr std::uint8_t kToHost = 0x80, kHidToHost = 0xa1, kHidToDevice = 0x21;
constexpr std::uint8_t kSetAddress = 5, kGetDescriptor = 6, kSetConfiguration = 9;
constexpr std::uint8_t kGetReport = 1, kSetReport = 9;
constexpr std::uint16_t kFeatureReport = 0x0300;
constexpr std::uint16_t kEnglish = 0x0409;

std::string TextOf(const ControlResult& result) {
  std::string text;
  for (std::size_t i = 2; i + 1 < result.data.size(); i += 2) {
    text += static_cast<char>(result.data[i]);
  }
  return text;
}

}  // namespace

void UsbHost::RunFrame() {
  const double start_us = device_.now_us();
  const double end_us = start_us + BenchDevice::kFrameUs;
  ++frame_;
  FollowPort();
  if (device_.powered()) {
    DriveBus();
    if (ready() && Converses()) Poll();
    if (device_.powered()) device_.chip().UpdateUsbInterrupts();
  }
  for (int slot = 1; slot <= kSlotsAFrame && !transfers_.empty() && Converses(); ++slot) {
    StepTransfer();
    device_.RunUntil(start_us + slot * BenchDevice::kFrameUs / kSlotsAFrame);
  }
  device_.RunUntil(end_us);
  if (!transfers_.empty() && Converses() && ++transfers_.front().age_frames > kTransferFrames) {
    Finish(TransferStatus::kTimeout);
  }
}

// Drives the bus state at the start of a frame; packets are handled elsewhere.
void UsbHost::DriveBus() {
  UsbController& usb = device_.usb();
  if (suspended_ && resume_frames_ == 0) {
    usb.IdleFrame();
    if (usb.TakeRemoteWake()) Resume();
    return;
  }
  if (resume_frames_ > 0) {
    const bool signals = resume_frames_-- > kResumeRecoveryFrames;
    suspended_ = resume_frames_ > 0;
    signals ? usb.Activity() : usb.StartOfFrame(frame_ & 0x7ff);
    return;
  }
  switch (state_) {
    case State::kDetached:
    case State::kDebouncing:  // the port is not enabled yet
      usb.IdleFrame();
      break;
    case State::kResetting:
      if (wait_frames_ > kResetRecoveryFrames) {
        usb.Activity();
        break;
      }
      [[fallthrough]];
    case State::kEnumerating:
    case State::kReady:
      usb.StartOfFrame(frame_ & 0x7ff);
      break;
  }
}

bool UsbHost::Converses() const { return !suspended_; }

void UsbHost::Suspend() { suspended_ = ready(); }

void UsbHost::Resume() {
  if (suspended_) resume_frames_ = kResumeFrames + kResumeRecoveryFrames;
}

bool UsbHost::RunUntilReady(int frames) {
  for (int i = 0; i < frames && !ready(); ++i) RunFrame();
  return ready();
}

void UsbHost::FollowPort() {
  const bool attached = device_.powered() && device_.usb().Attached();
  if (!attached) {
    if (state_ != State::kDetached) LoseDevice();
    return;
  }
  switch (state_) {
    case State::kDetached:
      state_ = State::kDebouncing;
      wait_frames_ = kDebounceFrames;
      break;
    case State::kDebouncing:
      if (--wait_frames_ <= 0) {
        state_ = State::kResetting;
        wait_frames_ = kResetFrames + kResetRecoveryFrames;
      }
      break;
    case State::kResetting:
      if (wait_frames_-- == kResetRecoveryFrames + 1) device_.usb().BusReset();
      if (wait_frames_ <= 0) {
        state_ = State::kEnumerating;
        Enumerate();
      }
      break;
    case State::kEnumerating:
    case State::kReady:
      break;
  }
}

void UsbHost::LoseDevice() {
  const bool was_ready = ready();
  state_ = State::kDetached;
  suspended_ = false;
  resume_frames_ = 0;
  address_ = 0;
  while (!transfers_.empty()) Finish(TransferStatus::kGone);
  if (was_ready && on_gone) on_gone();
}

void UsbHost::ResetPort() {
  LoseDevice();
  state_ = State::kResetting;
  wait_frames_ = kResetFrames + kResetRecoveryFrames;
}

// One transfer starts the next; the order is that of Linux.
void UsbHost::Enumerate() {
  address_ = 0;
  control_packet_ = 8;
  enumeration_ = {};
  const auto get = [this](std::uint16_t value, std::uint16_t index, std::uint16_t length,
                          auto take) {
    Submit({kToHost, kGetDescriptor, value, index, length}, {},
           [this, take](const ControlResult& result) {
             if (result.status == TransferStatus::kDone) {
               take(result);
             } else if (result.status != TransferStatus::kGone) {
               ResetPort();
             }
           });
  };
  get(0x0100, 0, 8, [this, get](const ControlResult& first) {
    if (first.data.size() < 8) return ResetPort();
    control_packet_ = first.data[7];
    const std::uint8_t address = next_address_;
    next_address_ = next_address_ == 127 ? 1 : static_cast<std::uint8_t>(next_address_ + 1);
    Submit({0, kSetAddress, address, 0, 0}, {}, [this, get, address](const ControlResult& result) {
      if (result.status == TransferStatus::kGone) return;
      if (result.status != TransferStatus::kDone) return ResetPort();
      address_ = address;
      get(0x0100, 0, 18, [this, get](const ControlResult& device) {
        if (device.data.size() < 18) return ResetPort();
        enumeration_.device_descriptor = device.data;
        get(0x0200, 0, 9, [this, get](const ControlResult& head) {
          if (head.data.size() < 4) return ResetPort();
          const auto total = static_cast<std::uint16_t>(head.data[2] | (head.data[3] << 8));
          get(0x0200, 0, total, [this](const ControlResult& all) {
            enumeration_.configuration_descriptor = all.data;
          });
          // Reads only the strings that exist: the descriptor holds their index, 0 for none.
          const std::pair<std::size_t, std::string*> strings[] = {{14, &enumeration_.manufacturer},
                                                                  {15, &enumeration_.product},
                                                                  {16, &enumeration_.serial}};
          for (const auto& [at, text] : strings) {
            const std::uint8_t number = enumeration_.device_descriptor[at];
            if (number == 0) continue;
            get(static_cast<std::uint16_t>(0x0300 | number), kEnglish, 255,
                [text = text](const ControlResult& string) { *text = TextOf(string); });
          }
          Submit({0, kSetConfiguration, 1, 0, 0}, {}, [](const ControlResult&) {});
          Submit({kToHost | 1, kGetDescriptor, 0x2200, 0, 512}, {},
                 [this](const ControlResult& descriptor) {
                   if (descriptor.status == TransferStatus::kGone) return;
                   enumeration_.report_descriptor = descriptor.data;
                   state_ = State::kReady;
                   expected_toggle_ = false;
                   if (on_ready) on_ready();
                 });
        });
      });
    });
  });
}

void UsbHost::Poll() {
  if (!wants_input()) return;
  std::vector<std::uint8_t> packet;
  bool toggle = false;
  switch (device_.usb().In(address_, protocol::kInputEndpoint, &packet, &toggle)) {
    case UsbAnswer::kAck:
      ++inputs_received_;
      if (toggle != expected_toggle_) ++toggle_errors_;
      expected_toggle_ = !toggle;
      if (on_input) on_input(packet);
      break;
    case UsbAnswer::kStall:
      if (on_input_stall) on_input_stall();
      break;
    case UsbAnswer::kNak:
    case UsbAnswer::kNone:
      break;
  }
}

void UsbHost::Submit(const SetupPacket& setup, std::vector<std::uint8_t> data,
                     ControlCallback callback) {
  if (state_ != State::kEnumerating && state_ != State::kReady) {
    callback({TransferStatus::kGone, {}});
    return;
  }
  transfers_.push_back({setup, std::move(data), std::move(callback), Stage::kSetup, 0, 0});
}

ControlResult UsbHost::Control(const SetupPacket& setup, const std::vector<std::uint8_t>& data) {
  ControlResult result;
  bool over = false;
  Submit(setup, data, [&](const ControlResult& r) {
    result = r;
    over = true;
  });
  while (!over) RunFrame();
  return result;
}

void UsbHost::SubmitGetFeature(std::uint8_t report_id, ControlCallback callback) {
  Submit({kHidToHost, kGetReport, static_cast<std::uint16_t>(kFeatureReport | report_id), 0,
          protocol::kLongestReportBytes},
         {}, std::move(callback));
}

void UsbHost::SubmitSetFeature(std::vector<std::uint8_t> report, ControlCallback callback) {
  const std::uint8_t id = report.empty() ? 0 : report.front();
  const auto length = static_cast<std::uint16_t>(report.size());
  Submit({kHidToDevice, kSetReport, static_cast<std::uint16_t>(kFeatureReport | id), 0, length},
         std::move(report), std::move(callback));
}

ControlResult UsbHost::GetFeature(std::uint8_t report_id) {
  return Control({kHidToHost, kGetReport, static_cast<std::uint16_t>(kFeatureReport | report_id), 0,
                  protocol::kLongestReportBytes});
}

ControlResult UsbHost::SetFeature(const std::vector<std::uint8_t>& report) {
  const std::uint8_t id = report.empty() ? 0 : report.front();
  return Control({kHidToDevice, kSetReport, static_cast<std::uint16_t>(kFeatureReport | id), 0,
                  static_cast<std::uint16_t>(report.size())},
                 report);
}

void UsbHost::Finish(TransferStatus status) {
  Transfer transfer = std::move(transfers_.front());
  transfers_.pop_front();
  ControlResult result{status, {}};
  if (transfer.setup.type & kToHost) result.data = std::move(transfer.data);
  if (transfer.callback) transfer.callback(result);
}

void UsbHost::StepTransfer() {
  if (!device_.powered()) return Finish(TransferStatus::kGone);
  Transfer& transfer = transfers_.front();
  const SetupPacket& setup = transfer.setup;
  UsbController& usb = device_.usb();
  const bool to_host = setup.type & kToHost;
  UsbAnswer answer = UsbAnswer::kNone;
  switch (transfer.stage) {
    case Stage::kSetup: {
      const std::uint8_t packet[8] = {setup.type,
                                      setup.request,
                                      static_cast<std::uint8_t>(setup.value),
                                      static_cast<std::uint8_t>(setup.value >> 8),
                                      static_cast<std::uint8_t>(setup.index),
                                      static_cast<std::uint8_t>(setup.index >> 8),
                                      static_cast<std::uint8_t>(setup.length),
                                      static_cast<std::uint8_t>(setup.length >> 8)};
      answer = usb.Setup(address_, packet);
      if (to_host) transfer.data.clear();
      if (answer == UsbAnswer::kAck) {
        transfer.stage = setup.length == 0 ? Stage::kStatus : Stage::kData;
      }
      break;
    }
    case Stage::kData:
      if (to_host) {
        std::vector<std::uint8_t> packet;
        answer = usb.In(address_, 0, &packet);
        if (answer == UsbAnswer::kAck) {
          transfer.data.insert(transfer.data.end(), packet.begin(), packet.end());
          if (packet.size() < control_packet_ || transfer.data.size() >= setup.length) {
            transfer.stage = Stage::kStatus;
          }
        }
      } else {
        const std::size_t size = std::min(control_packet_, transfer.data.size() - transfer.sent);
        answer = usb.Out(address_, 0, {transfer.data.data() + transfer.sent, size});
        if (answer == UsbAnswer::kAck) {
          transfer.sent += size;
          if (transfer.sent >= transfer.data.size()) transfer.stage = Stage::kStatus;
        }
      }
      break;
    case Stage::kStatus:
      if (to_host && setup.length != 0) {
        answer = usb.Out(address_, 0, {});
      } else {
        std::vector<std::uint8_t> packet;
        answer = usb.In(address_, 0, &packet);
      }
      device_.chip().UpdateUsbInterrupts();
      if (answer == UsbAnswer::kAck) return Finish(TransferStatus::kDone);
      break;
  }
  device_.chip().UpdateUsbInterrupts();
  if (answer == UsbAnswer::kStall) Finish(TransferStatus::kStall);
}

}  // namespace torquer::emulator
