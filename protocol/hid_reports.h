// Single definition of the reports that the bench device and the host exchange over USB HID.
//
// Its readers are firmware, daemon, emulator, tools and the tables in README.md. It compiles as
// C++14 under avr-gcc (no standard library there) and as C++20 on the host. Both are little-endian,
// and the structs are packed, so the bytes on the wire are the bytes in memory.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace torquer {
namespace protocol {

/// Version of every layout in this file. A host refuses a device with another version, and names
/// the remedy. README.md has the dated breaks.
constexpr uint8_t kProtocolVersion = 1;

/// HID report ids (byte 0 of each report).
enum ReportId : uint8_t {
  kInputReportId = 1,
  kIdentityReportId = 2,
  kConfigurationReportId = 3,
  kDiagnosticsReportId = 4,
  kCommandReportId = 5,
  kSromReportId = 6,
  kPictureReportId = 7,
  kSecondInputReportId = 8,  ///< an InputReport of the second sensor, the catheter's
};

/// Bits of InputReport::flags.
enum ReportFlag : uint8_t {
  kFlagMotion = 1 << 0,       ///< the sensor saw motion since the previous report
  kFlagLift = 1 << 1,         ///< the sensor is too far from the cylinder; its counts are in doubt
  kFlagSensorFault = 1 << 2,  ///< the sensor does not answer correctly; counts stand still
  kFlagReference = 1 << 3,    ///< the end switch has closed since the boot: reference_counts holds
  kFlagAtReference = 1 << 4,  ///< the end switch is closed now
  kFlagSromLost = 1 << 5,     ///< the sensor has lost the firmware image that the host had loaded
};

/// Bits of InputReport::buttons; 1 while held.
enum Button : uint8_t {
  kButtonXray = 1 << 0,
  kButtonContrast = 1 << 1,
  kButtonClutch = 1 << 2,
  kButtonStick = 1 << 3,  ///< chooses if the joystick moves the C-arm, the table, or its height
};

/// Full scale of InputReport::joystick_x and joystick_y; the center is calibrated.
constexpr uint16_t kJoystickMax = 1023;

/// The sensor's firmware image, a file of its maker's: bytes.
constexpr uint16_t kSromBytes = 4094;
/// The sensor's raw picture: pixels a side.
constexpr uint8_t kPictureSide = 36;
constexpr uint16_t kPicturePixels = kPictureSide * kPictureSide;

// clang-format off
#define TORQUER_INPUT_REPORT(FIELD)                                                                \
  FIELD(uint8_t,  report_id,         "1; 8 from the second sensor")                                \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion")                                           \
  FIELD(uint8_t,  flags,             "ReportFlag")                                                 \
  FIELD(uint8_t,  boot_id,           "changes at every reset of the device")                       \
  FIELD(uint8_t,  buttons,           "bit 0 X-ray, 1 contrast, 2 clutch, 3 stick; 1 while held")   \
  FIELD(uint16_t, sequence,          "one more than in the previous report; wraps")                \
  FIELD(uint32_t, device_time_us,    "device clock at sampling, us; wraps after 71.6 minutes")     \
  FIELD(int32_t,  axial_counts,      "cumulative counts, positive distally; wraps")                \
  FIELD(int32_t,  transverse_counts, "cumulative counts, positive right-handed; wraps")            \
  FIELD(uint16_t, joystick_x,        "0 .. 1023, grows to the right (LAO)")                        \
  FIELD(uint16_t, joystick_y,        "0 .. 1023, grows away from the user (CRA)")                  \
  FIELD(uint8_t,  surface_quality,   "number of surface features seen / 8")                        \
  FIELD(uint16_t, shutter,           "exposure, sensor clock ticks")                               \
  FIELD(uint16_t, cpi,               "counts an inch that the sensor is set to")                   \
  FIELD(int32_t,  reference_counts,  "axial_counts when the end switch last closed; 0 before")

#define TORQUER_IDENTITY_REPORT(FIELD)                                                             \
  FIELD(uint8_t,  report_id,         "2")                                                          \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion")                                           \
  FIELD(uint8_t,  firmware_major,    "firmware version")                                           \
  FIELD(uint8_t,  firmware_minor,    "firmware version")                                           \
  FIELD(uint8_t,  firmware_patch,    "firmware version")                                           \
  FIELD(uint8_t,  sensor_product_id, "0x42 for a PMW3360; 0 when none answers")                    \
  FIELD(uint8_t,  sensor_revision,   "as the sensor reports it")                                   \
  FIELD(uint8_t,  crystal_mhz,       "8 or 16")                                                    \
  FIELD_ARRAY(char, serial, 16,      "ASCII, zero-padded; equals the USB serial string")           \
  FIELD(uint8_t,  self_test,         "bit 0 application CRC, bit 1 settings, bit 2 sensor, bit 3 second sensor; 1 good") \
  FIELD(uint8_t,  board,             "ImageBoard; 0 from firmware before this field: 1")           \
  FIELD(uint8_t,  capabilities,      "Capability bits; 0 from firmware before this field")         \
  FIELD(uint8_t,  cpu_mhz,           "CPU clock, 8 or 16; 0 from firmware before this field: the crystal's") \
  FIELD(uint8_t,  second_product_id, "second sensor's product id; 0 where there is none") \
  FIELD(uint8_t,  second_revision,   "the same")                                                   \
  FIELD_ARRAY(uint8_t, spare, 2,     "0")

#define TORQUER_CONFIGURATION_REPORT(FIELD)                                                        \
  FIELD(uint8_t,  report_id,         "3")                                                          \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion")                                           \
  FIELD(uint16_t, cpi,               "100 .. 12000, a multiple of 100")                            \
  FIELD(uint16_t, joystick_deadzone, "0 .. 511, counts around the stick's rest reported as 512")    \
  FIELD(uint8_t,  closed_at_rest,    "Button bits of the contacts that are closed at rest")        \
  FIELD_ARRAY(uint8_t, spare, 9,     "0")

#define TORQUER_DIAGNOSTICS_REPORT(FIELD)                                                          \
  FIELD(uint8_t,  report_id,         "4")                                                          \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion")                                           \
  FIELD(uint8_t,  reset_reason,      "ResetReason bits; 0 unknown")                                \
  FIELD(uint8_t,  srom_id,           "sensor firmware id; 0 when none is loaded")                  \
  FIELD(uint16_t, sensor_faults,     "times the sensor had to be started again; saturates")        \
  FIELD(uint16_t, frames_missed,     "USB frames in which no report could be queued; saturates")   \
  FIELD(uint16_t, settings_writes,   "times the settings were written to EEPROM; saturates")       \
  FIELD(uint16_t, stack_headroom,    "bytes of stack never used since the reset")                  \
  FIELD(uint16_t, longest_frame_us,  "longest time from start of frame to report queued")          \
  FIELD(uint16_t, sensor_resets,     "times the sensor had reset itself; saturates")               \
  FIELD(uint8_t,  sensor_fault_cause, "SensorFaultCause of the latest fault")                      \
  FIELD(uint8_t,  sensor_observation, "Observation register when the sensor was started")          \
  FIELD(uint16_t, joystick_rest_x,   "reading at rest, measured at the start; 512 if it was not")  \
  FIELD(uint16_t, joystick_rest_y,   "the same")                                                   \
  FIELD(uint16_t, supply_mv,         "the chip's supply, +-10 %, in steps of 20 mV; 0 unknown")    \
  FIELD(uint16_t, second_faults,     "sensor_faults of the second sensor")                         \
  FIELD(uint16_t, second_resets,     "sensor_resets of the second sensor")                         \
  FIELD(uint8_t,  second_fault_cause, "sensor_fault_cause of the second sensor")                   \
  FIELD(uint8_t,  second_observation, "sensor_observation of the second sensor")                   \
  FIELD_ARRAY(uint8_t, spare, 2,     "0")

#define TORQUER_COMMAND_REPORT(FIELD)                                                              \
  FIELD(uint8_t,  report_id,         "5")                                                          \
  FIELD(uint8_t,  command,           "Command")                                                    \
  FIELD(uint16_t, key,               "kCommandKey, else the report is stalled")                    \
  FIELD_ARRAY(uint8_t, spare, 4,     "0")

#define TORQUER_SROM_REPORT(FIELD)                                                                 \
  FIELD(uint8_t,  report_id,         "6")                                                          \
  FIELD_ARRAY(uint8_t, image, 4094,  "the image as its maker provides it")

#define TORQUER_PICTURE_REPORT(FIELD)                                                              \
  FIELD(uint8_t,  report_id,         "7")                                                          \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion")                                           \
  FIELD(uint8_t,  surface_quality,   "number of surface features seen / 8, before the picture")    \
  FIELD(uint8_t,  spare,             "0")                                                          \
  FIELD(uint16_t, shutter,           "exposure before the picture, sensor clock ticks")            \
  FIELD_ARRAY(uint8_t, pixels, 1296, "brightness 0 .. 127, 36 rows of 36, as the sensor sends them")
// clang-format on

#define TORQUER_FIELD(type, name, meaning) type name;
#define FIELD_ARRAY(type, name, count, meaning) type name[count];
/// Input report, sent every millisecond: absolute, cumulative values, so that a lost report loses
/// no motion. One USB packet.
struct __attribute__((packed)) InputReport {
  TORQUER_INPUT_REPORT(TORQUER_FIELD)
};
/// Feature report, read only: identity of the device.
struct __attribute__((packed)) IdentityReport {
  TORQUER_IDENTITY_REPORT(TORQUER_FIELD)
};
/// Feature report, read and write: settings in the device's EEPROM.
struct __attribute__((packed)) ConfigurationReport {
  TORQUER_CONFIGURATION_REPORT(TORQUER_FIELD)
};
/// Feature report, read only: counters and faults since the device's last reset.
struct __attribute__((packed)) DiagnosticsReport {
  TORQUER_DIAGNOSTICS_REPORT(TORQUER_FIELD)
};
/// Feature report, write only: a command to the device.
struct __attribute__((packed)) CommandReport {
  TORQUER_COMMAND_REPORT(TORQUER_FIELD)
};
/// Feature report, write only: a firmware image for the sensor, in one transfer. The device takes
/// its bytes at the speed of the sensor, and acknowledges once the sensor runs the image. It stalls
/// if the sensor refuses the image. The sensor loses the image without power and by a reset.
struct __attribute__((packed)) SromReport {
  TORQUER_SROM_REPORT(TORQUER_FIELD)
};
/// Feature report, read only: picture of the sensor's camera. A request takes the picture, within a
/// second. The sensor then starts again, and loses a firmware image from the host.
struct __attribute__((packed)) PictureReport {
  TORQUER_PICTURE_REPORT(TORQUER_FIELD)
};
#undef TORQUER_FIELD
#undef FIELD_ARRAY

/// Length of the longest report. A host may pad every feature report that it writes to this length.
constexpr uint16_t kLongestReportBytes = sizeof(SromReport);

/// Bits of DiagnosticsReport::reset_reason: MCUSR at the start. Arduino's bootloader clears MCUSR.
/// The firmware then reports the cause that the memory shows, with kResetDerived, or 0.
enum ResetReason : uint8_t {
  kResetPower = 1 << 0,
  kResetPin = 1 << 1,
  kResetBrownOut = 1 << 2,
  kResetWatchdog = 1 << 3,
  kResetDerived = 1 << 7,
};

/// Bits of IdentityReport::capabilities.
enum Capability : uint8_t {
  kCapabilityClosedAtRest = 1 << 0,  ///< ConfigurationReport::closed_at_rest
  kCapabilitySupply = 1 << 1,        ///< DiagnosticsReport::supply_mv
  kCapabilitySrom = 1 << 2,          ///< SromReport, for the sensor that answers
  kCapabilityPicture = 1 << 3,       ///< PictureReport, for the sensor that answers
  kCapabilitySecondSensor = 1 << 4,  ///< input reports with kSecondInputReportId
};

/// Values of DiagnosticsReport::sensor_fault_cause.
enum SensorFaultCause : uint8_t {
  kSensorNoFault = 0,
  kSensorSilent = 1,       ///< equal bytes in a row: no power, a broken wire
  kSensorForeign = 2,      ///< another product id
  kSensorReset = 3,        ///< it has reset itself: its configuration, or its Observation, is gone
  kSensorFrozen = 4,       ///< it takes no frames
  kSensorSromRefused = 5,  ///< it did not take the firmware image
};

/// Values of CommandReport::command.
enum Command : uint8_t {
  kCommandZero = 1,             ///< cumulative counts become 0
  kCommandEnterBootloader = 2,  ///< restart into the bootloader
  kCommandReset = 3,            ///< restart the firmware
};
constexpr uint16_t kCommandKey = 0x7154;  // "Tq", so that a stray write has no effect

static_assert(sizeof(InputReport) == 32, "one USB packet");
static_assert(offsetof(InputReport, axial_counts) == 11, "see the byte table in README.md");
static_assert(sizeof(IdentityReport) == 32, "see the byte table in README.md");
static_assert(sizeof(ConfigurationReport) == 16, "see the byte table in README.md");
static_assert(sizeof(DiagnosticsReport) == 32, "see the byte table in README.md");
static_assert(sizeof(CommandReport) == 8, "see the byte table in README.md");
static_assert(sizeof(SromReport) == 1 + kSromBytes, "see the byte table in README.md");
static_assert(sizeof(PictureReport) == 6 + kPicturePixels, "see the byte table in README.md");

}  // namespace protocol
}  // namespace torquer
