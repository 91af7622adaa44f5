// Finds messages that a log lacks, by numbers and order of those that it has.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// Messages that a log should hold and does not. Commands are numbered; the daemon sends each
/// sample just after the command that it made of it; states are numbered by tick; the simulator
/// sends its scene after its status; status, readings and the emulator's truth come regularly.
class LogGaps {
 public:
  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::instrument_command_t& command);
  void Add(const torquer_lcm::wire_state_t& state);
  void Add(const torquer_lcm::health_t& health);
  void Add(const torquer_lcm::readings_t& readings);
  void Add(const torquer_lcm::hand_motion_t& truth);
  void AddScene();

  /// A phrase for each instrument or channel; empty where the log holds all by its numbers.
  std::vector<std::string> Describe() const;
  /// The same of what came later than it should: it is missing, or its sender was held up.
  std::vector<std::string> DescribeSilences() const;

 private:
  struct Instrument {
    std::int64_t commands = 0;
    std::int64_t samples = 0;
    std::int64_t missing_commands = 0;
    std::int64_t missing_samples = 0;
    std::int64_t disordered_commands = 0;  // twice, or before an earlier one
    std::int64_t disordered_samples = 0;
    std::int64_t received = -1;  // by the daemon, of reports
    bool ended = false;          // so the daemon said
    bool awaits_sample = false;  // of the last command
    torquer_lcm::instrument_command_t command;
    torquer_lcm::device_sample_t sample;
  };
  // `time_us`: of what the message says, by the sender's own clock.
  void AddRegular(const std::string& channel, const std::string& sender, std::int64_t publish_us,
                  double time_us, double latest_us);

  struct Sender {
    std::int64_t publish_us = 0;
    double time_us = 0;
    std::int64_t silences = 0;
    std::int64_t disordered = 0;
  };

  std::map<std::string, Instrument> instruments_;
  std::map<std::pair<std::string, std::string>, Sender> senders_;  // by channel and name
  std::int64_t states_ = 0;
  std::int64_t disordered_states_ = 0;
  torquer_lcm::wire_state_t state_;  // its numbers alone
  bool outline_ = false;             // so was that state
  double longest_solve_us_ = 0;      // since the last readings
  std::int64_t missing_scenes_ = 0;
  std::int64_t repeated_scenes_ = 0;
  bool simulator_spoke_ = false;
  bool awaits_scene_ = false;
};

}  // namespace torquer
