// Registers, keys and times of the PMW3360, from its data sheet, version 1.50. The PMW3389 has the
// same values, except where noted.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {
namespace pmw3360 {

constexpr uint8_t kProductId = 0x00;
constexpr uint8_t kRevisionId = 0x01;
constexpr uint8_t kMotion = 0x02;
constexpr uint8_t kDeltaYHigh = 0x06;
constexpr uint8_t kConfig1 = 0x0f;        // resolution: cpi / 100 - 1
constexpr uint8_t kResolutionLow = 0x0e;  // of a PMW3389: cpi / 50 - 1; the high byte stays 0
constexpr uint8_t kConfig2 = 0x10;        // bit 5: rest modes, on after a reset
constexpr uint8_t kFrameCapture = 0x12;
constexpr uint8_t kSromEnable = 0x13;
constexpr uint8_t kObservation = 0x24;
constexpr uint8_t kSromId = 0x2a;
constexpr uint8_t kPowerUpReset = 0x3a;
constexpr uint8_t kShutdown = 0x3b;
constexpr uint8_t kInverseProductId = 0x3f;
constexpr uint8_t kMotionBurst = 0x50;
constexpr uint8_t kSromLoadBurst = 0x62;
constexpr uint8_t kRawDataBurst = 0x64;
constexpr uint8_t kWriteBit = 0x80;

constexpr uint8_t kPmw3360Id = 0x42;
constexpr uint8_t kPmw3389Id = 0x47;
constexpr uint8_t kResetKey = 0x5a;
constexpr uint8_t kShutdownKey = 0xb6;
constexpr uint8_t kNoRest = 0x00;       // for Config2
constexpr uint8_t kConfig2Bits = 0x25;  // of Config2; bits 7:6, 4:3 and 1 are reserved
constexpr uint8_t kSromPrepare = 0x1d;
constexpr uint8_t kSromStart = 0x18;
constexpr uint8_t kCaptureFirst = 0x83;
constexpr uint8_t kCaptureSecond = 0xc5;

// A motion burst: its length, and bits of its first two bytes, Motion and Observation.
constexpr uint8_t kBurstBytes = 12;
constexpr uint8_t kMotionSeen = 0x80;
constexpr uint8_t kLifted = 0x08;
constexpr uint8_t kOperationMode = 0x06;  // 0 in run mode
constexpr uint8_t kFrameBits = 0x3f;      // come up in every frame

// Times in us, each minimum rounded up by one for the clock's resolution.
constexpr uint16_t kAddressToData = 161;    // tSRAD
constexpr uint16_t kAddressToBurst = 36;    // tSRAD_MOTBR
constexpr uint16_t kWriteToDeselect = 36;   // tSCLK-NCS for a write
constexpr uint16_t kAfterWrite = 181 - 36;  // tSWW, tSWR, the time until the deselect taken off
constexpr uint16_t kAfterRead = 21;         // tSRW, tSRR
constexpr uint16_t kAfterBurst = 2;         // tBEXIT is 500 ns
// tBEXIT of raw data: 4 us is not verified. Public drivers of this family wait 0.5 to 4 us after
// any burst; a longer pause does no harm.
constexpr uint16_t kAfterPicture = 5;
constexpr uint16_t kLongBurstByte = 16;  // between the bytes of a firmware image or a picture
constexpr uint16_t kAfterSrom = 201;
constexpr uint32_t kPowerUp = 50000;
constexpr uint32_t kAfterReset = 50000;
constexpr uint32_t kSromEnableWait = 10000;
constexpr uint32_t kObservationWait = 5000;  // tDLY_OBS: a frame in run mode, with room to spare
constexpr uint32_t kCaptureWait = 20000;
constexpr uint32_t kCaptureAfterReset = 250000;

}  // namespace pmw3360
}  // namespace firmware
}  // namespace torquer
