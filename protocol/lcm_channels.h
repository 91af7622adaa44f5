// LCM: the names of the channels, the version of the messages, and the bits in them
// (lcm/*.lcm).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace torquer::protocol {

inline constexpr char kDeviceSampleChannel[] = "TORQUER_DEVICE_SAMPLE";
inline constexpr char kInstrumentCommandChannel[] = "TORQUER_INSTRUMENT_COMMAND";
inline constexpr char kImagingCommandChannel[] = "TORQUER_IMAGING_COMMAND";
inline constexpr char kWedgeCommandChannel[] = "TORQUER_WEDGE_COMMAND";
inline constexpr char kInjectorCommandChannel[] = "TORQUER_INJECTOR_COMMAND";
inline constexpr char kTableCommandChannel[] = "TORQUER_TABLE_COMMAND";
inline constexpr char kExchangeCommandChannel[] = "TORQUER_EXCHANGE_COMMAND";
inline constexpr char kWireStateChannel[] = "TORQUER_WIRE_STATE";
inline constexpr char kSceneChannel[] = "TORQUER_SCENE";
inline constexpr char kDevicesChannel[] = "TORQUER_DEVICES";
inline constexpr char kReadingsChannel[] = "TORQUER_READINGS";
inline constexpr char kVitalSignsChannel[] = "TORQUER_VITAL_SIGNS";
inline constexpr char kWireForcesChannel[] = "TORQUER_WIRE_FORCES";
inline constexpr char kPictureChannel[] = "TORQUER_PICTURE";
inline constexpr char kLateralPictureChannel[] = "TORQUER_PICTURE_LATERAL";
inline constexpr char kHealthChannel[] = "TORQUER_HEALTH";
inline constexpr char kHandMotionChannel[] = "TORQUER_HAND_MOTION";
inline constexpr char kEmulatorTruthChannel[] = "TORQUER_EMULATOR_TRUTH";

/// All of them.
inline constexpr const char* kChannels[] = {kDeviceSampleChannel,    kInstrumentCommandChannel,
                                            kWireStateChannel,       kSceneChannel,
                                            kReadingsChannel,        kWireForcesChannel,
                                            kPictureChannel,         kHealthChannel,
                                            kHandMotionChannel,      kEmulatorTruthChannel,
                                            kImagingCommandChannel,  kLateralPictureChannel,
                                            kTableCommandChannel,    kVitalSignsChannel,
                                            kWedgeCommandChannel,    kInjectorCommandChannel,
                                            kExchangeCommandChannel, kDevicesChannel};

/// Most exchanges of instruments in a session, so that devices_t fits into a datagram.
inline constexpr std::size_t kMostExchanges = 200;

/// Version of the message types: any change of a type needs a new version (protocol/README.md).
inline constexpr std::int32_t kLcmVersion = 3;

/// Default name of an instrument.
inline constexpr char kGuidewire[] = "guidewire";

/// Name of the second sensor of a box, as a device with its own calibration and messages.
inline std::string SecondSerial(const std::string& serial) { return serial + ".2"; }

/// Number of the command after `sequence`, >= 0: one more, and zero after the largest.
constexpr std::int64_t NextSequence(std::int64_t sequence) {
  return static_cast<std::int64_t>((static_cast<std::uint64_t>(sequence) + 1) & INT64_MAX);
}

/// Bits of instrument_command_t::flags.
enum InstrumentFlag : std::int32_t {
  kCommandUncalibrated = 1 << 0,  ///< the daemon runs with nominal gains
  kCommandLift = 1 << 1,          ///< sensor lifted or surface poor: motion is held, not applied
  kCommandSensorFault = 1 << 2,   ///< the sensor does not answer
  kCommandClutch = 1 << 3,        ///< clutch held: the hand moves, the wire stays
  kCommandNoDevice = 1 << 4,      ///< no device: the last position is held
  kCommandStickTable = 1 << 5,    ///< the joystick moves the table, not the C-arm
  kCommandStickHeight = 1 << 6,   ///< the joystick moves the table up and down
};

/// imaging_command_t::mode.
enum ImagingMode : std::int32_t {
  kImagingAsScene = 0,      ///< the scene's `mode`
  kImagingPlain = 1,        ///< as the detector sees it
  kImagingSubtraction = 2,  ///< minus the first picture since the pedal went down
  kImagingRoadmap = 3,      ///< subtraction, with the densest dye so far as a bright map
  kImagingCine = 4,         ///< plain, with the dose of an acquisition
};

/// injector_command_t::order.
enum InjectorOrder : std::int32_t {
  kInjectorOff = 0,     ///< disarmed; stops an injection
  kInjectorArm = 1,     ///< armed for one injection, if the order before was another one
  kInjectorInject = 2,  ///< starts that injection, which continues while this order stands
};

/// Bits of vital_signs_t::alarms.
enum PatientAlarm : std::int32_t {
  kAlarmRateLow = 1 << 0,         ///< the heart rate is below its limit
  kAlarmRateHigh = 1 << 1,        ///< above
  kAlarmSystolicLow = 1 << 2,     ///< the systolic pressure is below its limit
  kAlarmSystolicHigh = 1 << 3,    ///< above
  kAlarmPressureDamped = 1 << 4,  ///< the tip closes the lumen: the pressure's course is damped
};

/// Bits of wire_state_t::status.
enum WireStatus : std::int32_t {
  kWireConverged = 1 << 0,     ///< residual below the scene's tolerance
  kWireBudgetSpent = 1 << 1,   ///< the tick's time was up before equilibrium
  kWireOutsideLumen = 1 << 2,  ///< the center of an instrument is beyond the wall
  kWireSnapped = 1 << 3,       ///< the tip moved much farther than the action explains
  kWireInputRefused = 1 << 4,  ///< a command was not finite or out of range; the last one stands
  kWireInDoubt = 1 << 5,  ///< a command reports lift, fault or no device, or commands have stopped
  kWireStalled = 1 << 6,  ///< out of balance, and no attempted step reduced the residual
  kWireLeftModel = 1 << 7,  ///< an instrument is held at an outlet, where the vessel's model ends
};

}  // namespace torquer::protocol
