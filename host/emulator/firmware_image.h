// Firmware image for the emulated chip: the bytes of its flash, and the symbols of an ELF file.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace torquer::emulator {

/// A firmware image as the compiler left it.
class FirmwareImage {
 public:
  /// Throws UserError naming the file and the remedy.
  explicit FirmwareImage(const std::string& elf_path);

  /// An application, its bootloader, or both; "" for none.
  static FirmwareImage Load(const std::string& application_elf, const std::string& bootloader_elf);

  /// Path of the firmware that was built with this program.
  static std::string OfThisBuild();

  /// Flash contents from address 0.
  const std::vector<std::uint8_t>& flash() const { return flash_; }
  /// Replaces the flash contents; the image's description of itself stays.
  void SetFlash(std::vector<std::uint8_t> contents) { flash_ = std::move(contents); }
  /// Puts another image's bytes into the flash: an application to its bootloader, or the other way
  /// round. Throws UserError if they overlap, or were built for different clocks.
  void Add(const FirmwareImage& other);
  /// Start address of the chip: 0, or the boot section if there is a bootloader.
  std::uint32_t boot_start() const { return boot_start_; }
  /// Value of a symbol (data addresses have 0x800000 added); throws UserError if there is none.
  std::uint32_t Symbol(const std::string& name) const;
  bool HasSymbol(const std::string& name) const { return symbols_.count(name) != 0; }

  /// The clocks that the image was built for, Hz: of the CPU, and of the crystal that feeds it.
  std::uint32_t cpu_hz() const { return cpu_hz_; }
  std::uint32_t crystal_hz() const { return crystal_hz_; }
  /// Circuit that the image was built for (protocol::ImageBoard).
  int board() const { return board_; }
  /// Changes the start value of an initialized 32-bit variable, and the image's CRC with it.
  void SetInitialValue(const std::string& variable, std::uint32_t value);

 private:
  void ReadBuild();
  std::uint32_t ClockNamed(const std::string& symbol) const;
  void SignAnew();

  std::string path_;
  std::uint32_t cpu_hz_ = 16000000;
  std::uint32_t crystal_hz_ = 16000000;
  int board_ = 1;
  std::uint32_t boot_start_ = 0;
  std::vector<std::uint8_t> flash_;
  std::map<std::string, std::uint32_t> symbols_;
};

}  // namespace torquer::emulator
