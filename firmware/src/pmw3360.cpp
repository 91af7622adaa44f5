#include "firmware/src/pmw3360.h"

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {

using pmw3360::kAfterReset;
using pmw3360::kAfterSrom;
using pmw3360::kBurstBytes;
using pmw3360::kCaptureAfterReset;
using pmw3360::kCaptureFirst;
using pmw3360::kCaptureSecond;
using pmw3360::kCaptureWait;
using pmw3360::kConfig1;
using pmw3360::kConfig2;
using pmw3360::kConfig2Bits;
using pmw3360::kDeltaYHigh;
using pmw3360::kFrameBits;
using pmw3360::kFrameCapture;
using pmw3360::kInverseProductId;
using pmw3360::kLifted;
using pmw3360::kMotion;
using pmw3360::kMotionBurst;
using pmw3360::kMotionSeen;
using pmw3360::kNoRest;
using pmw3360::kObservation;
using pmw3360::kObservationWait;
using pmw3360::kOperationMode;
using pmw3360::kPmw3360Id;
using pmw3360::kPmw3389Id;
using pmw3360::kPowerUp;
using pmw3360::kPowerUpReset;
using pmw3360::kProductId;
using pmw3360::kResetKey;
using pmw3360::kResolutionLow;
using pmw3360::kRevisionId;
using pmw3360::kShutdown;
using pmw3360::kShutdownKey;
using pmw3360::kSromEnable;
using pmw3360::kSromEnableWait;
using pmw3360::kSromId;
using pmw3360::kSromPrepare;
using pmw3360::kSromStart;

namespace {

constexpr uint8_t kBadReadingsToRestart = 3;
constexpr uint8_t kFramesBetweenChecks = 32;
constexpr uint8_t kFramesToObserve = 20;
constexpr uint8_t kBlindStarts = 3;
constexpr uint16_t kFirstBackoffMs = 100;
constexpr uint16_t kLastBackoffMs = 1600;

// Checks made in turn while the sensor runs.
enum Check : uint8_t { kCheckRest, kCheckCpi, kCheckIdentity, kCheckSromId, kCheckFrames, kChecks };
constexpr uint8_t kSromRunAndFrames = 0x7f;  // of Observation; the eighth bit is reserved

bool Uniform(const uint8_t burst[kBurstBytes]) {
  if (burst[0] != 0x00 && burst[0] != 0xff) return false;
  for (uint8_t i = 1; i < kBurstBytes; ++i) {
    if (burst[i] != burst[0]) return false;
  }
  return true;
}

void CountUp(uint16_t* count) {
  if (*count != UINT16_MAX) ++*count;
}

}  // namespace

void Pmw3360::Start(uint16_t cpi) {
  wanted_cpi_ = cpi;
  backoff_ms_ = kFirstBackoffMs;
  WaitThen(State::kWaitToReset, kPowerUp);
}

void Pmw3360::BeginRead() {
  if (state_ == State::kRunning) bus_.BeginMotion();
}

MotionSample Pmw3360::Read() {
  MotionSample sample;
  sample.fault = true;
  if (state_ != State::kRunning) return sample;

  uint8_t burst[kBurstBytes];
  bus_.FinishMotion(burst);

  // An unpowered sensor or a broken wire gives equal bytes in a row. A working sensor never does:
  // its pixel maximum is above its minimum.
  if (Uniform(burst)) {
    if (++bad_readings_ >= kBadReadingsToRestart) Fail(protocol::kSensorSilent);
    return sample;
  }
  sample.delta_x = static_cast<int16_t>(burst[2] | (static_cast<uint16_t>(burst[3]) << 8));
  sample.delta_y = static_cast<int16_t>(burst[4] | (static_cast<uint16_t>(burst[5]) << 8));

  // Signs of a sensor that has reset itself: rest mode, no frames at first, no firmware image. Its
  // counts then have another resolution, so they are withheld. Maintain() checks the sensor at
  // once. If only a byte was corrupted, the counts are not lost.
  if (frames_to_observe_ != 0 && (burst[1] & kFrameBits) != 0) {
    frames_to_observe_ = 0;
    next_check_ = kCheckRest;
    frames_to_check_ = 1;
  }
  const uint8_t expected =
      static_cast<uint8_t>(frames_to_observe_ != 0 ? observation_ & ~kFrameBits : observation_);
  if ((burst[1] & expected) != expected || (burst[0] & kOperationMode) != 0) {
    withheld_x_ = static_cast<int16_t>(withheld_x_ + sample.delta_x);
    withheld_y_ = static_cast<int16_t>(withheld_y_ + sample.delta_y);
    sample.delta_x = sample.delta_y = 0;
    in_doubt_ = true;
    if (++bad_readings_ >= kBadReadingsToRestart) Fail(protocol::kSensorReset);
    return sample;
  }
  bad_readings_ = 0;
  sample.delta_x = static_cast<int16_t>(sample.delta_x + withheld_x_);
  sample.delta_y = static_cast<int16_t>(sample.delta_y + withheld_y_);
  withheld_x_ = withheld_y_ = 0;

  sample.fault = false;
  sample.motion = burst[0] & kMotionSeen;
  sample.lifted = burst[0] & kLifted;
  sample.surface_quality = burst[6];
  sample.shutter = static_cast<uint16_t>((static_cast<uint16_t>(burst[10]) << 8) | burst[11]);
  return sample;
}

void Pmw3360::Maintain() {
  const uint32_t now_us = board::NowUs();
  if (static_cast<int32_t>(now_us - resume_at_us_) < 0) return;
  resume_at_us_ = now_us;  // after a wrap of the clock an old time would appear to be in the future
  switch (state_) {
    case State::kWaitToReset:
      bus_.Write(kPowerUpReset, kResetKey);
      shut_down_ = false;
      reset_at_us_ = board::NowUs();
      WaitThen(State::kSettle, kAfterReset);
      break;
    case State::kSettle:
      step_ = kMotion;
      state_ = State::kClearMotion;
      break;
    case State::kClearMotion:
      bus_.Read(step_);
      if (step_++ == kDeltaYHigh) {
        step_ = 0;
        state_ = State::kIdentify;
      }
      break;
    case State::kIdentify:
      if (step_ == 0) {
        product_id_ = bus_.Read(kProductId);
        revision_ = bus_.Read(kRevisionId);
        step_ = 1;
      } else if ((product_id_ == kPmw3360Id || product_id_ == kPmw3389Id) &&
                 bus_.Read(kInverseProductId) == static_cast<uint8_t>(~product_id_)) {
        step_ = 0;
        state_ = srom_wanted_ ? State::kPrepareSrom : State::kConfigure;
      } else {
        Fail(product_id_ == 0xff || product_id_ == 0 ? protocol::kSensorSilent
                                                     : protocol::kSensorForeign);
      }
      break;
    case State::kPrepareSrom:
      bus_.Write(kConfig2, kNoRest);
      state_ = State::kEnableSrom;
      break;
    case State::kEnableSrom:
      bus_.Write(kSromEnable, kSromPrepare);
      WaitThen(State::kStartSrom, kSromEnableWait);
      break;
    case State::kStartSrom:
      bus_.Write(kSromEnable, kSromStart);
      state_ = State::kAwaitSrom;
      break;
    case State::kCheckSrom:
      srom_id_ = bus_.Read(kSromId);
      if (srom_id_ == 0) {
        Fail(protocol::kSensorSromRefused);
      } else {
        srom_lost_ = false;
        state_ = State::kConfigure;
      }
      break;
    case State::kConfigure:
      if (step_ == 0) {
        bus_.Write(kConfig2, kNoRest);
        step_ = 1;
      } else {
        WriteResolution();
        state_ = State::kClearObservation;
      }
      break;
    case State::kClearObservation:
      bus_.Write(kObservation, 0);
      WaitThen(State::kObserve, kObservationWait);
      break;
    case State::kObserve:
      Observe();
      break;
    case State::kVerify:
      if (!Passes(step_)) {
        Fail(protocol::kSensorReset);
      } else if (++step_ == kCheckFrames) {
        ArmBurst();
        state_ = State::kDiscardMotion;
      }
      break;
    case State::kDiscardMotion: {
      uint8_t burst[kBurstBytes];
      bus_.BeginMotion();
      bus_.FinishMotion(burst);
      frames_to_check_ = kFramesBetweenChecks;
      frames_to_observe_ = bad_readings_ = 0;
      withheld_x_ = withheld_y_ = 0;
      state_ = State::kRunning;
      break;
    }
    case State::kRunning:
      if (picture_wanted_ && board::NowUs() - reset_at_us_ >= kCaptureAfterReset) {
        state_ = State::kBeginPicture;
      } else {
        CheckHealth();
      }
      break;
    case State::kBeginPicture:
      bus_.Write(kConfig2, kNoRest);
      state_ = State::kAskPicture;
      break;
    case State::kAskPicture:
      bus_.Write(kFrameCapture, kCaptureFirst);
      state_ = State::kTakePicture;
      break;
    case State::kTakePicture:
      bus_.Write(kFrameCapture, kCaptureSecond);
      WaitThen(State::kExposePicture, kCaptureWait);
      break;
    case State::kExposePicture:
      state_ = State::kPictureReady;
      break;
    case State::kShutDown:
      bus_.Write(kShutdown, kShutdownKey);
      shut_down_ = true;
      state_ = State::kAsleep;
      break;
    case State::kAwaitSrom:
    case State::kPictureReady:
    case State::kAsleep:
      break;
  }
}

// Records which frame bits the sensor shows now; every later burst must show the same bits. A
// sensor that shows none is restarted. If it still shows none after kBlindStarts starts, only its
// other answers are checked.
void Pmw3360::Observe() {
  observation_ = bus_.Read(kObservation) & kSromRunAndFrames;
  if ((observation_ & kFrameBits) != 0) {
    blind_starts_ = 0;
  } else if (++blind_starts_ < kBlindStarts) {
    Fail(protocol::kSensorFrozen);
    return;
  }
  step_ = 0;
  state_ = State::kVerify;
}

uint8_t Pmw3360::ResolutionRegister() const {
  return product_id_ == kPmw3389Id ? kResolutionLow : kConfig1;
}

uint8_t Pmw3360::ResolutionValue() const {
  return static_cast<uint8_t>(cpi_ / (product_id_ == kPmw3389Id ? 50 : 100) - 1);
}

void Pmw3360::WriteResolution() {
  cpi_ = wanted_cpi_;
  bus_.Write(ResolutionRegister(), ResolutionValue());
}

bool Pmw3360::Passes(uint8_t check) {
  switch (check) {
    case kCheckRest:
      return (bus_.Read(kConfig2) & kConfig2Bits) == kNoRest;
    case kCheckCpi:
      return bus_.Read(ResolutionRegister()) == ResolutionValue();
    case kCheckIdentity:
      return bus_.Read(kProductId) == product_id_;
    default:
      return bus_.Read(kSromId) == srom_id_;
  }
}

void Pmw3360::CheckHealth() {
  if (wanted_cpi_ != cpi_) {
    WriteResolution();
    ArmBurst();
    return;
  }
  if (frames_to_observe_ != 0) {
    --frames_to_observe_;
    if (frames_to_observe_ == 0) {
      Fail(protocol::kSensorFrozen);
      return;
    }
  }
  if (in_doubt_) {
    in_doubt_ = false;
    next_check_ = kCheckRest;
  } else if (--frames_to_check_ != 0) {
    return;
  }
  frames_to_check_ = kFramesBetweenChecks;
  const uint8_t check = next_check_;
  next_check_ = check + 1 == kChecks ? 0 : static_cast<uint8_t>(check + 1);
  if (check == kCheckFrames) {
    if ((observation_ & kFrameBits) == 0) return;
    bus_.Write(kObservation, 0);
    frames_to_observe_ = kFramesToObserve;
  } else if (!Passes(check)) {
    Fail(check == kCheckIdentity ? protocol::kSensorForeign : protocol::kSensorReset);
    return;
  }
  if (bad_readings_ == 0) backoff_ms_ = kFirstBackoffMs;
  ArmBurst();  // any other access ends the burst mode
}

void Pmw3360::ArmBurst() { bus_.Write(kMotionBurst, 0x00); }

void Pmw3360::RequestSrom() {
  srom_wanted_ = true;
  Restart();
}

void Pmw3360::SromSent() {
  srom_wanted_ = false;
  WaitThen(State::kCheckSrom, kAfterSrom);
}

void Pmw3360::AbandonSrom() {
  srom_wanted_ = false;
  Restart();
}

bool Pmw3360::RequestPicture() {
  picture_wanted_ = running();
  return picture_wanted_;
}

void Pmw3360::EndPicture() {
  if (!picture_wanted_) return;
  picture_wanted_ = false;
  // A picture that was not begun needs no restart of the sensor.
  if (state_ != State::kRunning) Restart();
}

void Pmw3360::Sleep() {
  ForgetSrom();
  srom_wanted_ = picture_wanted_ = false;
  // After power-up or a reset, resume_at_us_ is the time of the first allowed access.
  state_ = shut_down_ ? State::kAsleep : State::kShutDown;
  bad_readings_ = 0;
}

void Pmw3360::Wake() { state_ = State::kWaitToReset; }

void Pmw3360::ForgetSrom() {
  srom_lost_ = srom_lost_ || srom_id_ != 0;
  srom_id_ = 0;
}

void Pmw3360::Restart() {
  ForgetSrom();
  bad_readings_ = 0;
  WaitThen(State::kWaitToReset, 0);
}

void Pmw3360::Fail(protocol::SensorFaultCause cause) {
  CountUp(&restarts_);
  if (cause == protocol::kSensorReset) CountUp(&self_resets_);
  fault_cause_ = cause;
  const bool was_running = state_ == State::kRunning;
  // The id of an unknown sensor is reported. Values that were read without a sensor are not.
  if (cause != protocol::kSensorForeign || was_running) product_id_ = revision_ = 0;
  srom_wanted_ = picture_wanted_ = false;
  Restart();
  // A sensor that has reset itself still answers, so it is started at once.
  if (was_running && cause == protocol::kSensorReset) return;
  WaitThen(State::kWaitToReset, static_cast<uint32_t>(backoff_ms_) * 1000);
  if (backoff_ms_ < kLastBackoffMs) backoff_ms_ = static_cast<uint16_t>(backoff_ms_ * 2);
}

void Pmw3360::WaitThen(State next, uint32_t us) {
  resume_at_us_ = board::NowUs() + us;
  state_ = next;
}

}  // namespace firmware
}  // namespace torquer
