// Writes the states of a script as JSON lines or binary, to a file or to standard output.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/program/state_fields.h"
#include "host/support/atomic_file.h"
#include "host/support/standard_streams.h"

namespace torquer::program {

/// Version of the binary format (host/simulator/README.md); changes with the layout.
inline constexpr int kStatesVersion = 2;

class StatesOutput {
 public:
  /// `path`: kStandardStream or a file. A file that ends in ".bin" gets binary states; otherwise
  /// the output is one JSON object a line. `streams` must outlive this. Throws UserError as
  /// AtomicFile.
  StatesOutput(const std::string& path, std::vector<StateField> fields, StandardStreams& streams);

  /// Returns false if the reader has gone. Throws UserError if writing fails.
  bool Write(const StateRow& row);
  /// Moves the file to its final name; see AtomicFile::Finish.
  void Finish();

 private:
  std::string AsJson(const StateRow& row) const;
  std::string AsBytes(const StateRow& row) const;

  const std::vector<StateField> fields_;
  StandardStreams& streams_;
  const bool binary_;
  std::optional<AtomicFile> file_;
};

}  // namespace torquer::program
