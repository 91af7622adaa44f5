// Clock test: the wall clock jumps while the whole chain runs. No wait and no measurement may use
// it.
#include <catch2/catch.hpp>
#include <cstdint>
#include <string>

#include "host/support/event_log.h"
#include "tests/faults/faulty_run.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {

TEST_CASE("A session continues and repeats while the clock jumps a day ahead and back") {
  const TemporaryFolder folder;
  ChildProcess demo(WithSetting(
      "TORQUER_CLOCK_JUMP_S=86400",
      {"/bin/bash", SourcePath("/host/demo"), "--scene", "ty_phantom", "--duration", "3",
       "--no-install", "--programs", ProgramPath(""), "--files", folder.Path("session")}));
  const int status = demo.Wait();
  INFO(demo.Output() << demo.Error());
  CHECK(status == 0);

  const std::string log = folder.Path("session/latest/session.lcmlog");
  constexpr std::int64_t kHourUs = 3'600'000'000;
  EventLogReader reader(log);
  LogRecord record;
  REQUIRE(reader.Next(record));
  const std::int64_t first_us = record.time_us;
  for (std::int64_t before_us = first_us; reader.Next(record); before_us = record.time_us) {
    REQUIRE(record.time_us >= before_us);
  }
  CHECK(record.time_us - first_us < kHourUs);

  ChildProcess replay(WithSetting("TORQUER_CLOCK_JUMP_S=86400",
                                  {ProgramPath("torquer-simulator"), "--scene",
                                   SourcePath("/host/scenes/ty_phantom.toml"), "--replay", log}));
  CHECK(replay.Wait() == 0);
  CHECK_THAT(replay.Output() + replay.Error(), Catch::Contains(" 0 differ"));
}

}  // namespace torquer::test
