#include "host/tools/board_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "host/support/error.h"
#include "host/tools/board_reports.h"
#include "protocol/serial_number.h"

namespace torquer::tools {
namespace {

using protocol::BootloaderStatusReport;
using protocol::IdentityReport;

// Time for udev to grant permissions, and for the kernel to create a serial port.
constexpr int kSettleMs = 2000;

}  // namespace

std::string SerialOf(const protocol::BootloaderStatusReport& status) {
  char serial[protocol::kSerialBytes + 1] = {};
  protocol::MakeSerialNumber(status.given_serial, status.chip_serial, serial);
  return serial;
}

std::string Where(const Board& board) { return "USB " + board.place; }

BoardSearch::BoardSearch(Boards& boards, std::string device, std::string port)
    : boards_(boards), device_(std::move(device)), port_(std::move(port)) {}

FoundBoard BoardSearch::Find() { return Examine(Choose()); }

Board BoardSearch::Choose() {
  if (!port_.empty()) {
    for (const Board& board : boards_.List()) {
      if (board.mode == BoardMode::kSketch && board.port == port_) return board;
    }
    Board board;
    board.mode = BoardMode::kCaterina;
    board.port = port_;
    return board;
  }
  for (int waited = 0;; waited += kLookMs) {
    std::vector<Board> boards = boards_.List();
    const bool settled = std::none_of(boards.begin(), boards.end(),
                                      [](const Board& b) { return !b.problem.empty(); });
    if (settled || waited >= kSettleMs) {
      std::string seen;
      std::vector<Board> wanted;
      for (const Board& board : boards) {
        if (!device_.empty() && board.problem.empty() &&
            (board.mode == BoardMode::kFirmware || board.mode == BoardMode::kBootloader) &&
            Examine(board).serial != device_) {
          seen += " " + Examine(board).serial;
          continue;
        }
        wanted.push_back(board);
      }
      if (wanted.size() > 1 && device_.empty()) {
        std::string places;
        for (const Board& board : wanted) places += "; " + Examine(board).state;
        throw UserError("several boards are plugged in" + places +
                        ". Choose one with --device SERIAL, or unplug the others.");
      }
      const auto of_ours = std::find_if(wanted.begin(), wanted.end(), [](const Board& b) {
        return b.mode == BoardMode::kFirmware || b.mode == BoardMode::kBootloader;
      });
      if (!device_.empty() && of_ours == wanted.end()) {
        throw UserError("no board with the serial number " + device_ + " is plugged in" +
                        (seen.empty() ? "." : "; there is:" + seen + "."));
      }
      if (wanted.empty()) {
        throw UserError(
            "no board found. Plug in the bench device. A new Arduino board has to be reset first "
            "(a "
            "Pro Micro twice within a second); then run torquer-flash within 8 s.");
      }
      return of_ours != wanted.end() ? *of_ours : wanted.front();
    }
    boards_.Sleep(kLookMs);
  }
}

FoundBoard BoardSearch::Examine(const Board& board) {
  if (!board.problem.empty()) throw UserError(Where(board) + ": " + board.problem);
  FoundBoard found;
  found.board = board;
  found.crystal_mhz = board.crystal_mhz;
  try {
    switch (board.mode) {
      case BoardMode::kFirmware:
        return ExamineFirmware(board);
      case BoardMode::kBootloader:
        return ExamineBootloader(board);
      case BoardMode::kCaterina:
        found.state = board.place.empty() ? "a board in Caterina at " + board.port
                                          : Where(board) + ", in Arduino's Caterina bootloader";
        return found;
      case BoardMode::kSketch:
        found.state =
            fmt::format("{} at {}, which runs an Arduino program", Where(board), board.port);
        if (!board.port.empty() && board.port == port_) return found;
        throw UserError(
            Where(board) + " runs an Arduino program. " +
            (board.port.empty()
                 ? ""
                 : fmt::format("If that may be overwritten, name its port: torquer-flash --port "
                               "{}. Or reset it ",
                               board.port)) +
            (board.port.empty() ? "Reset it " : "") +
            "(a Pro Micro twice within a second), which starts its bootloader for 8 s, and run the "
            "same command again.");
      case BoardMode::kDfu:
        throw UserError(
            Where(board) +
            " is in the chip's factory bootloader (DFU), which starts an application without a "
            "check. Install Torquer's bootloader by ISP (firmware/bootloader/README.md), or only "
            "the firmware: dfu-programmer atmega32u4 erase && dfu-programmer atmega32u4 flash "
            "FILE.hex && dfu-programmer atmega32u4 reset");
    }
  } catch (const BoardLost& lost) {
    throw UserError(
        fmt::format("{}: the board is gone ({}). Nothing was changed. Check the cable and "
                    "run the same command again.",
                    Where(board), lost.what()));
  } catch (const ReportRefused& refused) {
    throw UserError(
        fmt::format("{}: the board does not report its identity ({}). Nothing was changed. Unplug "
                    "it, plug it in and run the same command again.",
                    Where(board), refused.what()));
  }
  return found;
}

FoundBoard BoardSearch::ExamineFirmware(const Board& board) {
  FoundBoard found;
  found.board = board;
  const auto link = boards_.Open(board);
  const auto identity = Get<IdentityReport>(*link, protocol::kIdentityReportId);
  found.serial = board.serial;
  // Firmware from before this field is for board 1.
  found.image_board =
      identity.board != 0 ? int{identity.board} : int{protocol::kBoardBenchAtmega32u4};
  if (!protocol::IsKnownBoard(static_cast<std::uint8_t>(found.image_board))) {
    throw UserError(fmt::format(
        "{} at {}: its firmware is for {}; this program supports {}. Use the torquer-flash of the "
        "release that the firmware is from.",
        found.serial, Where(board), BoardText(found.image_board), KnownBoardsText()));
  }
  found.crystal_mhz = identity.crystal_mhz;
  found.cpu_mhz = identity.cpu_mhz != 0 ? identity.cpu_mhz : identity.crystal_mhz;
  found.installed =
      FirmwareVersion{identity.firmware_major, identity.firmware_minor, identity.firmware_patch};
  found.state = fmt::format("{} at {}, running firmware {} for {} at {}", found.serial,
                            Where(board), found.installed->Text(), BoardText(found.image_board),
                            ClockText(found.crystal_mhz, found.cpu_mhz));
  if (!(identity.self_test & kApplicationGood)) found.state += ", which is damaged";
  return found;
}

FoundBoard BoardSearch::ExamineBootloader(const Board& board) {
  FoundBoard found;
  found.board = board;
  const auto link = boards_.Open(board);
  const auto status = Get<BootloaderStatusReport>(*link, protocol::kBootloaderStatusReportId);
  found.serial = SerialOf(status);
  const std::string name = found.serial + " at " + Where(board);
  if (status.protocol_version != protocol::kBootloaderProtocolVersion ||
      !protocol::IsKnownBoard(status.board)) {
    throw UserError(
        fmt::format("{}: its bootloader has version {} for {}; this program supports version {} "
                    "for {}. Use the torquer-flash of the release that the bootloader is from.",
                    name, int{status.protocol_version}, BoardText(status.board),
                    protocol::kBootloaderProtocolVersion, KnownBoardsText()));
  }
  found.image_board = status.board;
  found.crystal_mhz = protocol::CrystalMhz(status.clock);
  found.cpu_mhz = protocol::CpuMhz(status.clock);
  found.state =
      fmt::format("{}, in our bootloader for {} at {}, ", name, BoardText(found.image_board),
                  ClockText(found.crystal_mhz, found.cpu_mhz));
  if (status.application_valid) {
    found.installed = VersionOf(status.trailer);
    found.state += "with firmware " + found.installed->Text() + " ready to start";
  } else {
    found.state += "without a valid application: an update was interrupted, or there was none yet";
  }
  return found;
}

}  // namespace torquer::tools
