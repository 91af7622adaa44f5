// The two long reports: a firmware image for the sensor, and a picture from the sensor.
//
// Both are bursts without pauses, longer than a frame. During a burst the device does no other work
// and sends no input report. A picture takes 25 ms, an image about 0.1 s.
#pragma once

#include <stdint.h>

#include "firmware/src/motion_sensor.h"
#include "firmware/src/pmw3360.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

class SensorService final : public SensorReports {
 public:
  explicit SensorService(Pmw3360& sensor) : sensor_(sensor) {}

  bool BeginWrite(uint8_t id, uint16_t size) override;
  bool HasRoom() const override;
  void Put(uint8_t byte) override;
  Progress EndWrite() override;
  bool BeginRead(uint8_t id) override;
  Progress Read(const uint8_t** data, uint16_t* size) override;
  void Abandon() override;

  void Note(const MotionSample& sample) override;
  bool Run() override;
  uint8_t capabilities() const override {
    return protocol::kCapabilitySrom | protocol::kCapabilityPicture;
  }

 private:
  enum class Job : uint8_t { kNone, kFill, kStream, kSettle, kRefused, kPicture, kPictureTaken };

  void Pump();
  void TakePicture();

  Pmw3360& sensor_;
  uint32_t since_us_ = 0;  // the host has been waited for
  uint16_t taken_ = 0;     // bytes of the report from the host
  uint16_t sent_ = 0;      // bytes of the image to the sensor
  uint16_t put_ = 0;       // places in the ring
  uint16_t get_ = 0;
  uint16_t shutter_ = 0;
  uint8_t surface_quality_ = 0;
  Job job_ = Job::kNone;
  bool starved_ = false;
  // The picture while it is read, or the waiting bytes of an image.
  union {
    protocol::PictureReport picture_;
    uint8_t ring_[sizeof(protocol::PictureReport)];
  };
};

}  // namespace firmware
}  // namespace torquer
