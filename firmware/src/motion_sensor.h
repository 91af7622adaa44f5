// Motion sensor: the interface that the firmware requires of an optical sensor.
#pragma once

#include <stdint.h>

#include "firmware/src/usb_stack.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

/// One reading. While `fault` is set, the deltas are zero.
struct MotionSample {
  int16_t delta_x = 0;  ///< counts since the previous reading
  int16_t delta_y = 0;
  bool motion = false;
  bool lifted = false;  ///< too far from the surface
  bool fault = false;   ///< the sensor does not answer as it should
  uint8_t surface_quality = 0;
  uint16_t shutter = 0;
};

class MotionSensor {
 public:
  /// Call once, at power-up. The next calls of Maintain() start the sensor; until it runs, Read()
  /// reports a fault.
  virtual void Start(uint16_t cpi) = 0;

  /// Latches the newest motion. Call once a frame, and Read() about 40 us later. The sensor needs
  /// that time; other short work can use it.
  virtual void BeginRead() = 0;
  /// Reads the motion; takes at most 120 us.
  virtual MotionSample Read() = 0;

  /// Starts and checks the sensor, and starts it again after a fault: one step per call, at most
  /// 450 us. Call once a frame, after the report is queued; a frame that is short of time may omit
  /// the call.
  virtual void Maintain() = 0;

  /// Puts the sensor to sleep, so that it draws no current. Maintain() does so as soon as the
  /// sensor accepts commands. Read() reports a fault.
  virtual void Sleep() = 0;
  /// Ends the sleep; the sensor starts as at power-up.
  virtual void Wake() = 0;

  /// Sets the counts per inch; takes effect within a few frames.
  virtual void SetCpi(uint16_t cpi) = 0;
  /// Present counts per inch.
  virtual uint16_t cpi() const = 0;

  virtual uint8_t product_id() const = 0;  ///< 0 when none answers
  virtual uint8_t revision() const = 0;    ///< 0 when none answers
  virtual uint16_t restarts() const = 0;   ///< after the first start; saturates
  virtual bool running() const = 0;
  /// Spontaneous resets of the sensor; saturates.
  virtual uint16_t self_resets() const = 0;
  virtual protocol::SensorFaultCause fault_cause() const = 0;  ///< of the latest fault
  /// The sensor's register of that name at the last start; 0 if the sensor has none.
  virtual uint8_t observation() const = 0;
  /// Number of the firmware image that the sensor runs; 0 if it runs its ROM.
  virtual uint8_t srom_id() const = 0;
  /// True if the sensor has lost an image by a reset, and no image has been loaded since.
  virtual bool srom_lost() const = 0;

 protected:
  ~MotionSensor() = default;
};

/// Long reports of a sensor: its firmware image, its picture.
class SensorReports : public LongReportHandler {
 public:
  /// Keeps the values that are reported with a picture. Call once a frame.
  virtual void Note(const MotionSample& sample) = 0;
  /// Continues the current job; true during a burst to the sensor. Then only the USB is polled and
  /// Run() is called; all other work waits. Call at every step.
  virtual bool Run() = 0;
  /// Supported long reports, as protocol::Capability bits.
  virtual uint8_t capabilities() const = 0;

 protected:
  ~SensorReports() = default;
};

}  // namespace firmware
}  // namespace torquer
