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
  /// To be called once, at power-up. The calls of Maintain() that follow start the sensor; until it
  /// runs, Read() reports a fault.
  virtual void Start(uint16_t cpi) = 0;

  /// Takes the newest motion, now. To be called once a frame, and Read() after it: something short
  /// can be done in between, for which the sensor needs some 40 us.
  virtual void BeginRead() = 0;
  /// Reads the motion; takes at most 120 us.
  virtual MotionSample Read() = 0;

  /// Starting, checking and, after a fault, starting again: one step a call, at most 450 us. To be
  /// called once a frame, after the report is on its way; one may be left out if time is short.
  virtual void Maintain() = 0;

  /// From now on the sensor is not to draw current: Maintain() sends it to sleep as soon as it can
  /// be spoken to. Read() reports a fault.
  virtual void Sleep() = 0;
  /// Ends that; the sensor is started as at power-up.
  virtual void Wake() = 0;

  /// Counts an inch from now on; takes effect within a few frames.
  virtual void SetCpi(uint16_t cpi) = 0;
  /// Counts per inch to which the sensor is set.
  virtual uint16_t cpi() const = 0;

  virtual uint8_t product_id() const = 0;  ///< 0 when none answers
  virtual uint8_t revision() const = 0;    ///< 0 when none answers
  virtual uint16_t restarts() const = 0;   ///< after the first start; saturates
  virtual bool running() const = 0;
  /// Times that it had reset itself; saturates.
  virtual uint16_t self_resets() const = 0;
  virtual protocol::SensorFaultCause fault_cause() const = 0;  ///< of the latest fault
  /// Its register of that name when it was started; 0 where it has none.
  virtual uint8_t observation() const = 0;
  /// The number of the firmware image that the sensor runs; 0: its ROM.
  virtual uint8_t srom_id() const = 0;
  /// The sensor has lost an image by a reset, and no other has been loaded since.
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
  /// protocol::Capability bits of what it can do.
  virtual uint8_t capabilities() const = 0;

 protected:
  ~SensorReports() = default;
};

}  // namespace firmware
}  // namespace torquer
