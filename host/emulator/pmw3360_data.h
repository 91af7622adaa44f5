// Data sheet of the PMW3360, version 1.50, as numbers: registers, values after a reset, keys,
// times. For pmw3360.cpp alone.
#pragma once

#include <cstdint>
#include <utility>

namespace torquer::emulator::pmw3360_data {

// Registers of the data sheet, version 1.50.
inline constexpr std::uint8_t kProductId = 0x00, kRevisionId = 0x01, kMotion = 0x02,
                              kDeltaXLow = 0x03, kDeltaYHigh = 0x06, kSurfaceQuality = 0x07,
                              kRawDataSum = 0x08, kMaximumRawData = 0x09, kMinimumRawData = 0x0a,
                              kShutterLower = 0x0b, kShutterUpper = 0x0c, kControl = 0x0d,
                              kConfig2 = 0x10, kFrameCapture = 0x12, kSromEnable = 0x13,
                              kRunDownshift = 0x14, kRest1Rate = 0x15, kRest1Downshift = 0x17,
                              kRest2Rate = 0x18, kRest2Downshift = 0x1a, kRest3Rate = 0x1b,
                              kObservation = 0x24, kSromId = 0x2a, kMinimumQualityRun = 0x2b,
                              kRawDataThreshold = 0x2c, kConfig5 = 0x2f, kPowerUpReset = 0x3a,
                              kShutdown = 0x3b, kInverseProductId = 0x3f, kMotionBurst = 0x50,
                              kSromLoadBurst = 0x62, kLiftConfig = 0x63, kRawDataBurst = 0x64;
inline constexpr std::pair<std::uint8_t, std::uint8_t> kResetValues[] = {
    {kProductId, 0x42},        {kRevisionId, 0x01},    {kMotion, 0x20},
    {kShutterLower, 0x12},     {kControl, 0x02},       {0x0f, 0x31},
    {kConfig2, 0x20},          {kRunDownshift, 0x32},  {kRest1Rate, 0x00},
    {kRest1Downshift, 0x1f},   {kRest2Rate, 0x63},     {kRest2Downshift, 0xbc},
    {kRest3Rate, 0xf3},        {kRest3Rate + 1, 0x01}, {kMinimumQualityRun, 0x10},
    {kRawDataThreshold, 0x0a}, {kConfig5, 0x31},       {kInverseProductId, 0xbd},
    {kLiftConfig, 0x02}};
inline constexpr std::uint8_t kReadOnly[] = {
    kProductId,      kRevisionId,   kSurfaceQuality, kRawDataSum, kMaximumRawData,
    kMinimumRawData, kShutterLower, kShutterUpper,   kSromId,     kInverseProductId};
inline constexpr std::uint8_t kResetKey = 0x5a, kShutdownKey = 0xb6, kRestEnable = 0x20;
// Reserved bits of Config2. The data sheet states no value of theirs after a write; here they read
// as ones then.
inline constexpr std::uint8_t kReservedConfig2 = 0xda;
inline constexpr std::uint8_t kSromPrepare = 0x1d, kSromStart = 0x18;
inline constexpr std::uint8_t kCaptureFirst = 0x83, kCaptureSecond = 0xc5;
inline constexpr std::uint8_t kForeignId = 0x33;
// Values of a PMW3389 that differ. Its resolution is in steps of 50 counts an inch, in two bytes.
inline constexpr std::uint8_t kResolutionLow = 0x0e, kResolutionHigh = 0x0f;
inline constexpr std::pair<std::uint8_t, std::uint8_t> kPmw3389Values[] = {
    {kProductId, 0x47}, {kInverseProductId, 0xb8}, {kResolutionLow, 0x63}, {kResolutionHigh, 0x00}};
inline constexpr std::uint8_t kSromRun = 0x40, kFrameBits = 0x3f;

// Minimum times in us, by the names of the data sheet.
inline constexpr double kSelectToClock = 0.120, kAddressToData = 160, kAddressToBurst = 35,
                        kClockToDeselectRead = 0.120, kClockToDeselectWrite = 35, kAfterWrite = 180,
                        kAfterRead = 20, kBurstExit = 0.5, kRawDataExit = 4, kLongBurstByte = 15,
                        kStartUp = 50000, kSromPrepareWait = 10000, kCaptureWait = 20000,
                        kCaptureAfterReset = 250000;
inline constexpr double kMaxClockHz = 2e6;
inline constexpr int kSromBytes = 4094;
inline constexpr double kMillisecond_us = 1000;

}  // namespace torquer::emulator::pmw3360_data
