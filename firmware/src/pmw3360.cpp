#include "firmware/src/pmw3360.h"

#include "firmware/board/board.h"
#include "firmware/src/srom_image.h"

namespace torquer {
namespace firmware {
namespace {

// Registers.
constexpr uint8_t kProductId = 0x00;
constexpr uint8_t kRevisionId = 0x01;
constexpr uint8_t kMotion = 0x02;
constexpr uint8_t kDeltaYHigh = 0x06;
constexpr uint8_t kConfig1 = 0x0f;  // resolution: cpi / 100 - 1
constexpr uint8_t kConfig2 = 0x10;
constexpr uint8_t kSromEnable = 0x13;
constexpr uint8_t kSromId = 0x2a;
constexpr uint8_t kPowerUpReset = 0x3a;
constexpr uint8_t kShutdown = 0x3b;
constexpr uint8_t kInverseProductId = 0x3f;
constexpr uint8_t kMotionBurst = 0x50;
constexpr uint8_t kSromLoadBurst = 0x62;
constexpr uint8_t kWriteBit = 0x80;

constexpr uint8_t kExpectedProductId = 0x42;
constexpr uint8_t kExpectedInverseId = 0xbd;
constexpr uint8_t kResetKey = 0x5a;
constexpr uint8_t kShutdownKey = 0xb6;

// Bits of the first byte of a burst.
constexpr uint8_t kMotionSeen = 0x80;
constexpr uint8_t kLifted = 0x08;

// Timing of the data sheet in us, each rounded up by one for the clock's resolution.
constexpr uint16_t kAddressToData = 161;    // tSRAD
constexpr uint16_t kAddressToBurst = 36;    // tSRAD_MOTBR
constexpr uint16_t kWriteToDeselect = 36;   // tSCLK-NCS for a write
constexpr uint16_t kAfterWrite = 181 - 36;  // tSWW, tSWR, the time until the deselect taken off
constexpr uint16_t kAfterRead = 21;         // tSRW, tSRR
constexpr uint16_t kAfterBurst = 2;         // tBEXIT is 500 ns
constexpr uint16_t kSromByte = 16;          // between the bytes of an SROM
constexpr uint16_t kAfterSrom = 201;
constexpr uint32_t kPowerUp = 50000;
constexpr uint32_t kAfterReset = 50000;
constexpr uint32_t kSromEnableWait = 10000;

constexpr uint8_t kBurstBytes = 12;
constexpr uint8_t kSromBytesAStep = 16;
constexpr uint8_t kBadReadingsToRestart = 3;
constexpr uint8_t kFramesBetweenChecks = 250;
constexpr uint16_t kFirstBackoffMs = 100;
constexpr uint16_t kLastBackoffMs = 1600;

}  // namespace

void Pmw3360::Start(uint16_t cpi) {
  wanted_cpi_ = cpi;
  backoff_ms_ = kFirstBackoffMs;
  WaitThen(State::kWaitToReset, kPowerUp);
}

MotionSample Pmw3360::Read() {
  MotionSample sample;
  sample.fault = true;
  if (state_ != State::kRunning) return sample;

  uint8_t burst[kBurstBytes];
  WaitUntilReady();
  board::SelectSensor(true);
  board::TransferSpi(kMotionBurst);
  board::DelayUs(kAddressToBurst);
  for (uint8_t& byte : burst) byte = board::TransferSpi(0);
  board::SelectSensor(false);
  ready_at_us_ = board::NowUs() + kAfterBurst;

  // A sensor without power, or a broken wire, gives a row of equal bytes; a living one never does:
  // its pixel maximum is above its minimum.
  bool uniform = burst[0] == 0x00 || burst[0] == 0xff;
  for (uint8_t i = 1; i < kBurstBytes; ++i) uniform = uniform && burst[i] == burst[0];
  if (uniform) {
    if (++bad_readings_ >= kBadReadingsToRestart) Fail();
    return sample;
  }
  bad_readings_ = 0;

  sample.fault = false;
  sample.motion = burst[0] & kMotionSeen;
  sample.lifted = burst[0] & kLifted;
  sample.delta_x = static_cast<int16_t>(burst[2] | (static_cast<uint16_t>(burst[3]) << 8));
  sample.delta_y = static_cast<int16_t>(burst[4] | (static_cast<uint16_t>(burst[5]) << 8));
  sample.surface_quality = burst[6];
  sample.shutter = static_cast<uint16_t>((static_cast<uint16_t>(burst[10]) << 8) | burst[11]);
  return sample;
}

void Pmw3360::Maintain() {
  const uint32_t now_us = board::NowUs();
  if (static_cast<int32_t>(now_us - resume_at_us_) < 0) return;
  resume_at_us_ = now_us;  // an old time would seem to lie ahead once the clock has wrapped
  switch (state_) {
    case State::kWaitToReset:
      WriteRegister(kPowerUpReset, kResetKey);
      shut_down_ = false;
      WaitThen(State::kSettle, kAfterReset);
      break;
    case State::kSettle:
      step_ = kMotion;
      state_ = State::kClearMotion;
      break;
    case State::kClearMotion:
      ReadRegister(step_);
      if (step_++ == kDeltaYHigh) {
        step_ = 0;
        state_ = State::kIdentify;
      }
      break;
    case State::kIdentify:
      if (step_ == 0) {
        product_id_ = ReadRegister(kProductId);
        revision_ = ReadRegister(kRevisionId);
        step_ = 1;
      } else if (product_id_ == kExpectedProductId &&
                 ReadRegister(kInverseProductId) == kExpectedInverseId) {
        state_ = kSromImageBytes ? State::kPrepareSrom : State::kSetCpi;
      } else {
        Fail();
      }
      break;
    case State::kPrepareSrom:
      WriteRegister(kConfig2, 0x00);
      state_ = State::kEnableSrom;
      break;
    case State::kEnableSrom:
      WriteRegister(kSromEnable, 0x1d);
      WaitThen(State::kStartSrom, kSromEnableWait);
      break;
    case State::kStartSrom:
      WriteRegister(kSromEnable, 0x18);
      srom_sent_ = 0;
      state_ = State::kLoadSrom;
      break;
    case State::kLoadSrom:
      LoadSromBytes();
      break;
    case State::kCheckSrom:
      srom_id_ = ReadRegister(kSromId);
      if (srom_id_ == 0) {
        Fail();
      } else {
        WriteRegister(kConfig2, 0x00);
        state_ = State::kSetCpi;
      }
      break;
    case State::kSetCpi:
      ApplyCpi();
      frames_to_check_ = kFramesBetweenChecks;
      bad_readings_ = 0;
      state_ = State::kRunning;
      break;
    case State::kRunning:
      CheckHealth();
      break;
    case State::kShutDown:
      WriteRegister(kShutdown, kShutdownKey);
      shut_down_ = true;
      state_ = State::kAsleep;
      break;
    case State::kAsleep:
      break;
  }
}

void Pmw3360::Sleep() {
  if (state_ == State::kLoadSrom) {  // in the middle of its one long access
    board::SelectSensor(false);
    ready_at_us_ = board::NowUs() + kAfterSrom;
  }
  // After power-up or a reset resume_at_us_ is when it may be spoken to.
  state_ = shut_down_ ? State::kAsleep : State::kShutDown;
  bad_readings_ = 0;
  srom_id_ = 0;
}

void Pmw3360::Wake() { state_ = State::kWaitToReset; }

// A sensor that restarted by itself, after a dip of its supply, forgets its resolution and answers
// with its defaults: plausible, and wrong.
void Pmw3360::CheckHealth() {
  if (wanted_cpi_ != cpi_) {
    ApplyCpi();
    return;
  }
  if (--frames_to_check_ != 0) return;
  frames_to_check_ = kFramesBetweenChecks;
  const bool check_id = step_ ^= 1;
  const bool healthy = check_id ? ReadRegister(kProductId) == kExpectedProductId
                                : ReadRegister(kConfig1) == static_cast<uint8_t>(cpi_ / 100 - 1);
  if (healthy) {
    backoff_ms_ = kFirstBackoffMs;
    ArmBurst();
  } else {
    Fail();
  }
}

void Pmw3360::LoadSromBytes() {
  if (srom_sent_ == 0) {
    WaitUntilReady();
    board::SelectSensor(true);
    board::TransferSpi(kSromLoadBurst | kWriteBit);
  }
  for (uint8_t i = 0; i < kSromBytesAStep && srom_sent_ < kSromImageBytes; ++i) {
    board::DelayUs(kSromByte);
    board::TransferSpi(board::ReadFlash(kSromImage + srom_sent_++));
  }
  if (srom_sent_ < kSromImageBytes) return;
  board::DelayUs(kSromByte);
  board::SelectSensor(false);
  ready_at_us_ = board::NowUs() + kAfterSrom;
  state_ = State::kCheckSrom;
}

void Pmw3360::ApplyCpi() {
  cpi_ = wanted_cpi_;
  WriteRegister(kConfig1, static_cast<uint8_t>(cpi_ / 100 - 1));
  ArmBurst();
}

// Once armed, every burst begins with the burst address alone, until another register is accessed.
void Pmw3360::ArmBurst() { WriteRegister(kMotionBurst, 0x00); }

void Pmw3360::Fail() {
  if (restarts_ != UINT16_MAX) ++restarts_;
  board::SelectSensor(false);
  bad_readings_ = 0;
  srom_id_ = 0;
  // What another sensor answered is worth reporting; what no sensor answered is not.
  if (state_ != State::kIdentify || product_id_ == 0xff) product_id_ = revision_ = 0;
  WaitThen(State::kWaitToReset, static_cast<uint32_t>(backoff_ms_) * 1000);
  if (backoff_ms_ < kLastBackoffMs) backoff_ms_ = static_cast<uint16_t>(backoff_ms_ * 2);
}

void Pmw3360::WaitThen(State next, uint32_t us) {
  resume_at_us_ = board::NowUs() + us;
  state_ = next;
}

void Pmw3360::WaitUntilReady() {
  const int32_t remaining = static_cast<int32_t>(ready_at_us_ - board::NowUs());
  if (remaining > 0) board::DelayUs(static_cast<uint16_t>(remaining));
}

uint8_t Pmw3360::ReadRegister(uint8_t address) {
  WaitUntilReady();
  board::SelectSensor(true);
  board::TransferSpi(address);
  board::DelayUs(kAddressToData);
  const uint8_t value = board::TransferSpi(0);
  board::SelectSensor(false);
  ready_at_us_ = board::NowUs() + kAfterRead;
  return value;
}

void Pmw3360::WriteRegister(uint8_t address, uint8_t value) {
  WaitUntilReady();
  board::SelectSensor(true);
  board::TransferSpi(address | kWriteBit);
  board::TransferSpi(value);
  board::DelayUs(kWriteToDeselect);
  board::SelectSensor(false);
  ready_at_us_ = board::NowUs() + kAfterWrite;
}

}  // namespace firmware
}  // namespace torquer
