// Gap detection in a log: missing messages are found by the numbers and order of the others.
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

/// Messages that a log should contain but lacks. Commands are numbered. The daemon sends each
/// sample just after the command computed from it. States are numbered by tick. The simulator sends
/// its scene after its status. Status, readings and the emulator's truth are periodic.
class LogGaps {
 public:
  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::instrument_command_t& command);
  void Add(const torquer_lcm::wire_state_t& state);
  void Add(const torquer_lcm::health_t& health);
  void Add(const torquer_lcm::readings_t& readings);
  void Add(const torquer_lcm::hand_motion_t& truth);
  void AddScene();

  /// Number of commands that are missing, of all instruments.
  std::int64_t missing_commands() const;
  /// One phrase for each gap of an instrument or channel; empty if no number is missing.
  std::vector<std::string> Describe() const;
  /// One phrase for each sender with late periodic messages: they are missing or the sender was
  /// delayed.
  std::vector<std::string> DescribeSilences() const;

 private:
  struct Instrument {
    std::int64_t commands = 0;
    std::int64_t samples = 0;
    std::int64_t missing_commands = 0;
    std::int64_t missing_samples = 0;
    std::int64_t disordered_commands = 0;  // repeated, or out of order
    std::int64_t disordered_samples = 0;
    std::int64_t received = -1;  // reports that the daemon received; -1: unknown
    bool ended = false;          // the daemon has reported its end
    bool awaits_sample = false;  // the sample of the last command has not come yet
    torquer_lcm::instrument_command_t command;
    torquer_lcm::device_sample_t sample;
  };
  // `time_us`: time that the message states, by the sender's own clock.
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
  torquer_lcm::wire_state_t state_;  // last state; only its numbers are set
  bool outline_ = false;             // the last state was an outline
  double longest_solve_us_ = 0;      // since the last readings
  std::int64_t missing_scenes_ = 0;
  std::int64_t repeated_scenes_ = 0;
  bool simulator_spoke_ = false;
  bool awaits_scene_ = false;
};

}  // namespace torquer
