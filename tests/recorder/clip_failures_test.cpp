// torquer-clip: damaged logs, bad command lines, encoders and disks that fail.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/recorder/clip_fixture.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;
using Catch::Contains;
using Catch::StartsWith;

TEST_CASE("A damaged log becomes a clip, with status 1 and a list of the missing pictures") {
  const TemporaryFolder folder;
  ClipFaults made;
  made.damaged_picture = true;
  WriteScreenLog(folder.Path("log"), made);
  const ProgramRun picture = Clip({folder.Path("log"), folder.Path("clip.mp4")});
  CHECK(picture.status == 1);
  CHECK_THAT(picture.error, Contains("1 messages or pictures are damaged and left out"));
  const Video video(folder, folder.Path("clip.mp4"));
  REQUIRE(video.frames() == 75);
  CheckFrame(video, 40, 60, false, true);

  WriteScreenLog(folder.Path("log2"));
  std::filesystem::resize_file(folder.Path("log2"),
                               std::filesystem::file_size(folder.Path("log2")) - 3);
  const ProgramRun cut = Clip({folder.Path("log2"), folder.Path("clip2.webm")});
  CHECK(cut.status == 1);
  CHECK_THAT(cut.error, StartsWith("torquer-clip: " + folder.Path("log2") + ": "));
  CHECK(Video(folder, folder.Path("clip2.webm")).frames() == 75);
}

TEST_CASE("A clip that fails is reported and leaves no file") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  WriteScreenLog(log);
  WriteSession(folder.Path("no_pictures"), {});
  const std::string clip = folder.Path("clip.mp4");
  const auto refuses = [&](const std::vector<std::string>& words, const std::string& reason) {
    CAPTURE(words);
    const ProgramRun outcome = RunWords(words);
    CHECK(outcome.status == 2);
    CHECK(outcome.output.empty());
    CHECK_THAT(outcome.error, StartsWith("torquer-clip: "));
    CHECK_THAT(outcome.error, Contains(reason));
    CheckLeft(folder, {"log", "no_pictures"});
  };
  const std::string program = ProgramPath("torquer-clip");
  refuses({program, log}, "OUT is missing");
  refuses({program, log, folder.Path("clip.avi")}, "ends in .mp4 or .webm");
  refuses({program, log, folder.Path("none/clip.mp4")}, "cannot be written");
  refuses({program, folder.Path("none"), clip}, "cannot be read");
  refuses({program, folder.Path("no_pictures"), clip}, "holds no picture");
  refuses({program, log, clip, "--from", "2", "--to", "2"}, "--to is not later than --from");
  refuses({program, log, clip, "--from", "3.5"}, "its pictures are from 0.50 s to 3.00 s");
  refuses({program, log, clip, "--to", "0.4"}, "its pictures are from 0.50 s to 3.00 s");
  refuses({"/usr/bin/env", "PATH=/none", program, log, clip},
          "ffmpeg: cannot be started: No such file or directory; install it");
}

TEST_CASE("An encoder that ends well without a whole video leaves the old clip") {
  const std::string name = GENERATE("clip.mp4", "clip.webm");
  const std::string writes = GENERATE("", "cat > /dev/null", "cat > /dev/null; echo no video >&3",
                                      "cat > /dev/null; printf '\\0\\0\\0\\40ftypisom' >&3",
                                      "cat > /dev/null; printf '\\32\\105\\337\\243' >&3");
  CAPTURE(name, writes);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  std::ofstream(folder.Path("ffmpeg")) << "#!/bin/bash\n" << writes << "\nexit 0\n";
  std::filesystem::permissions(folder.Path("ffmpeg"), std::filesystem::perms::owner_all);
  std::ofstream(folder.Path(name)) << "old";
  const std::string path = folder.Path("") + ":/usr/bin:/bin";
  const ProgramRun outcome = RunWords({"/usr/bin/env", "PATH=" + path, ProgramPath("torquer-clip"),
                                       folder.Path("log"), folder.Path(name)});
  CHECK(outcome.status == 2);
  CHECK_THAT(outcome.error, StartsWith("torquer-clip: ffmpeg: ended with status 0, but "));
  CHECK(Contents(folder.Path(name)) == "old");
}

TEST_CASE("A disk that becomes full at any time leaves the old clip or none") {
  const bool mp4 = GENERATE(true, false);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string clip = folder.Path(mp4 ? "clip.mp4" : "clip.webm");
  // With the limit's signal ignored, the write fails with an error, as on a full disk.
  const auto make = [&](int most_blocks) {
    return RunWords({"/bin/bash", "-c", "trap '' XFSZ; ulimit -f $0; exec \"$@\"",
                     std::to_string(most_blocks), ProgramPath("torquer-clip"), folder.Path("log"),
                     clip});
  };
  int refused = 0;
  for (int most_kb = 1; most_kb < 100; ++most_kb) {
    CAPTURE(most_kb);
    const ProgramRun outcome = make(most_kb);
    if (outcome.status == 0) break;
    ++refused;
    CHECK(outcome.status == 2);
    CHECK_THAT(outcome.error, StartsWith("torquer-clip: ffmpeg: "));
    CheckLeft(folder, {"log"});
  }
  CAPTURE(refused);
  CHECK(refused > 3);
  CHECK(Video(folder, clip).frames() == 75);

  std::ofstream(clip) << "old";
  CHECK(make(3).status == 2);
  CHECK(Contents(clip) == "old");
}
