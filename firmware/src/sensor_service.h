// The two long reports: a firmware image on its way to the sensor, and a picture on its way from
// it.
//
// Both are bursts that must not pause, longer than what a frame leaves time for: while one is under
// way nothing else is done, for 25 ms (picture) or some 0.1 s (image), and no input report is sent.
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
  // The picture as it is read, or the bytes of an image that wait for their turn.
  union {
    protocol::PictureReport picture_;
    uint8_t ring_[sizeof(protocol::PictureReport)];
  };
};

}  // namespace firmware
}  // namespace torquer
