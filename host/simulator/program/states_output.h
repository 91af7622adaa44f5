// Where the states of a script go: JSON lines or binary, to a file or to standard output.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/program/state_fields.h"
#include "host/support/atomic_file.h"
#include "host/support/standard_streams.h"

namespace torquer::program {

/// Of binary states (host/simulator/README.md); a change of the layout changes it.
inline constexpr int kStatesVersion = 2;

class StatesOutput {
 public:
  /// `path`: kStandardStream; a file that ends in ".bin", which gets them binary; or any other one,
  /// which gets a JSON object a line. `streams` must outlive this. Throws UserError as AtomicFile.
  StatesOutput(const std::string& path, std::vector<StateField> fields, StandardStreams& streams);

  /// False where nobody reads any more. Throws UserError when writing has failed.
  bool Write(const StateRow& row);
  /// Puts a file in its place; as AtomicFile::Finish.
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
