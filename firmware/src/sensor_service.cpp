#include "firmware/src/sensor_service.h"

#include "firmware/board/board.h"

namespace torquer {
namespace firmware {
namespace {

// Longest wait for the next bytes of an image: before the burst, and within it. A pause within the
// burst makes the image invalid.
constexpr uint32_t kPatienceUs = 1000000;
constexpr uint32_t kPatienceInBurstUs = 2000;
constexpr uint16_t kPacketBytes = 32;

}  // namespace

bool SensorService::BeginWrite(uint8_t id, uint16_t size) {
  if (id != protocol::kSromReportId || size != sizeof(protocol::SromReport)) return false;
  if (!sensor_.running()) return false;
  sensor_.RequestSrom();
  taken_ = sent_ = put_ = get_ = 0;
  since_us_ = board::NowUs();
  job_ = Job::kFill;
  return true;
}

// The ring counts as full when one packet has no room. Then the burst begins.
bool SensorService::HasRoom() const {
  if (job_ == Job::kRefused) return true;  // takes and discards the rest
  constexpr uint16_t kRingBytes = sizeof(ring_);
  const uint16_t used =
      static_cast<uint16_t>(put_ >= get_ ? put_ - get_ : put_ + kRingBytes - get_);
  return used < kRingBytes - kPacketBytes;
}

void SensorService::Put(uint8_t byte) {
  if (taken_++ == 0) return;  // the report's id
  if (job_ != Job::kFill && job_ != Job::kStream) return;
  ring_[put_] = byte;
  if (++put_ == sizeof(ring_)) put_ = 0;
  if (job_ == Job::kStream) Pump();
}

// Sends one byte to the sensor, after the required pause.
void SensorService::Pump() {
  const uint16_t get = get_;
  if (get == put_) {
    if (!starved_) since_us_ = board::NowUs();
    starved_ = true;
    return;
  }
  starved_ = false;
  Pmw3360Bus::ExchangeInLongBurst(ring_[get]);
  get_ = get + 1 == sizeof(ring_) ? 0 : static_cast<uint16_t>(get + 1);
  if (++sent_ != protocol::kSromBytes) return;
  sensor_.bus().EndLongBurst(pmw3360::kAfterSrom);
  sensor_.SromSent();
  job_ = Job::kSettle;
}

LongReportHandler::Progress SensorService::EndWrite() {
  switch (job_) {
    case Job::kFill:
    case Job::kStream:
      return Progress::kWait;
    case Job::kSettle:
      if (!sensor_.Settled()) return Progress::kWait;
      job_ = Job::kNone;
      return sensor_.srom_id() != 0 ? Progress::kReady : Progress::kRefused;
    default:
      job_ = Job::kNone;
      return Progress::kRefused;
  }
}

bool SensorService::BeginRead(uint8_t id) {
  if (id != protocol::kPictureReportId || !sensor_.RequestPicture()) return false;
  job_ = Job::kPicture;
  return true;
}

LongReportHandler::Progress SensorService::Read(const uint8_t** data, uint16_t* size) {
  if (job_ == Job::kPicture) return Progress::kWait;
  if (job_ != Job::kPictureTaken) return Progress::kRefused;
  job_ = Job::kNone;
  *data = ring_;
  *size = sizeof(picture_);
  return Progress::kReady;
}

void SensorService::Abandon() {
  if (job_ == Job::kStream) sensor_.bus().EndLongBurst(pmw3360::kAfterSrom);
  if (job_ == Job::kFill || job_ == Job::kStream) sensor_.AbandonSrom();
  if (job_ == Job::kPicture) sensor_.EndPicture();
  job_ = Job::kNone;
}

void SensorService::Note(const MotionSample& sample) {
  if (sample.fault) return;
  surface_quality_ = sample.surface_quality;
  shutter_ = sample.shutter;
}

bool SensorService::Run() {
  switch (job_) {
    case Job::kFill:
      if (sensor_.AwaitsSrom() && !HasRoom()) {
        sensor_.bus().BeginLongBurst(pmw3360::kSromLoadBurst | pmw3360::kWriteBit);
        starved_ = false;
        job_ = Job::kStream;
      } else if (board::NowUs() - since_us_ > kPatienceUs) {
        Abandon();
        job_ = Job::kRefused;
      }
      break;
    case Job::kStream:
      Pump();
      if (starved_ && board::NowUs() - since_us_ > kPatienceInBurstUs) {
        Abandon();
        job_ = Job::kRefused;
      }
      break;
    case Job::kPicture:
      if (sensor_.PictureReady()) {
        TakePicture();
      } else if (!sensor_.picture_wanted()) {  // it failed on the way
        job_ = Job::kRefused;
      }
      break;
    default:
      break;
  }
  return job_ == Job::kStream;
}

void SensorService::TakePicture() {
  picture_.report_id = protocol::kPictureReportId;
  picture_.protocol_version = protocol::kProtocolVersion;
  picture_.surface_quality = surface_quality_;
  picture_.spare = 0;
  picture_.shutter = shutter_;
  sensor_.bus().BeginLongBurst(pmw3360::kRawDataBurst);
  for (uint16_t i = 0; i < protocol::kPicturePixels; ++i) {
    picture_.pixels[i] = Pmw3360Bus::ExchangeInLongBurst(0);
  }
  sensor_.bus().EndLongBurst(pmw3360::kAfterPicture);
  sensor_.EndPicture();
  job_ = Job::kPictureTaken;
}

}  // namespace firmware
}  // namespace torquer
