#include "host/simulator/vessel/mesh_import.h"

#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>
#include <vector>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_answer.h"
#include "host/support/error.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using test::TemporaryFolder;

// Error message of a refusal; "" if nothing is refused.
template <typename Read>
std::string Refusal(Read read) {
  try {
    read();
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

std::string TubeAsObj() {
  const TemporaryFolder folder;
  WriteObj(folder.Path("a.obj"), MakeClosedTube());
  return test::Contents(folder.Path("a.obj"));
}

MeshReader Quick() {
  MeshReader reader = MeshReader::For(0);
  reader.cpu_s = 1;
  return reader;
}

// Program in place of torquer-mesh-reader, as if a malicious file had taken control of it.
class Impostor {
 public:
  explicit Impostor(const std::string& script) {
    reader.program = folder_.Path("reader");
    std::ofstream(reader.program) << "#!/bin/bash\n" << script << '\n';
    chmod(reader.program.c_str(), 0700);
    reader.clock_s = 60;
  }
  TriangleMesh Read() const { return ImportMesh("", "a.ply", 1, reader); }

  MeshReader reader = Quick();

 private:
  TemporaryFolder folder_;
};

std::string AnswerAsScript(const std::string& answer) {
  std::string script = "printf '";
  for (const unsigned char byte : answer) {
    char text[8];
    std::snprintf(text, sizeof text, "\\x%02x", byte);
    script += text;
  }
  return script + "'";
}

std::ptrdiff_t OpenFiles() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

bool HasChildren() { return waitpid(-1, nullptr, WNOHANG) >= 0 || errno != ECHILD; }

TEST_CASE("files on which a reader of surfaces may crash or hang are refused by name") {
  const std::ptrdiff_t open_before = OpenFiles();
  const auto refused = [](const std::string& contents, const std::string& part) {
    CHECK_THAT(Refusal([&] { ImportMesh(contents, "bad.ply", 1, Quick()); }),
               Contains("bad.ply: ") && Contains(part) && Contains("export it again"));
  };
  using namespace std::string_literals;
  // On the first two inputs, assimp 5.2.4 crashes or never ends.
  refused("ply\nformat binary_\0\0"s, "end_header");
  refused("ply\nformat ascii", "end_header");
  const std::string ply = "ply\nformat ascii 1.0\nelement vertex ";
  refused(ply + "4000000000\nproperty float x\nend_header\n1\n", "4000000000");
  refused(ply + "99999999999999999999\nproperty float x\nend_header\n1\n", "more elements");
  std::string fan = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf";
  for (int k = 0; k < 400; ++k) fan += " 1 2 3";
  CHECK_THAT(Refusal([&] { ImportMesh(fan + "\n", "fan.obj", 1, Quick()); }),
             Contains("fan.obj: ") && Contains("1200 corners"));
  CHECK(OpenFiles() == open_before);
  CHECK_FALSE(HasChildren());
}

TEST_CASE("a surface whose header takes assimp long is refused") {
  const auto many = [](const std::string& line, int times) {
    std::string lines;
    for (int k = 0; k < times; ++k) lines += line + std::to_string(k) + "\n";
    return lines;
  };
  const auto refusal = [](const std::string& contents, const std::string& name) {
    return Refusal([&] { ImportMesh(contents, name, 1, Quick()); });
  };
  const auto ply = [&](int comments) {
    return "ply\nformat ascii 1.0\n" + many("comment ", comments) +
           "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
           "0 0 0\n9 0 0\n0 9 0\n3 0 1 2\n";
  };
  CHECK(refusal(ply(992), "a.ply").empty());
  CHECK_THAT(refusal(ply(993), "a.ply"),
             Contains("a.ply: the header has more than 1000 lines; export it again"));
}

TEST_CASE("objects, groups and materials of an OBJ file cost little and have no effect") {
  const double slowness = test::kUnderSanitizer ? 20 : 1;
  const std::string corners = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 9 9 0\n";
  std::string file = corners;
  for (int k = 0; k < 20'000; ++k) {
    const std::string number = std::to_string(k);
    file += "o part " + number + "\ng group " + number + "\nusemtl m" + number + "\nmtllib l" +
            number + "\nf 1/1/1 2//2 3/3\n";
  }
  const auto begin = std::chrono::steady_clock::now();
  const TriangleMesh mesh = ImportMesh(file, "a.obj", 1);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  CHECK(mesh.triangles.size() == 20'000);
  CHECK(took.count() < slowness * 2e-6 * static_cast<double>(file.size()));

  const auto area = [&](const std::string& faces) {
    return ImportMesh(corners + faces, "a.obj", 1).Area();
  };
  CHECK(area("f 1 2 4 3\n") == Approx(81));
  CHECK(ImportMesh("\xef\xbb\xbf" + corners + "f 1 2 4 3\n", "a.obj", 1).Area() == Approx(81));
  CHECK(area("f -4 -3 \\\n -1 -2\n") == Approx(81));
  CHECK(area("f 1 2 \\\r\n 4 3\r\n# f 1 2 3\r\nl 1 2\r\np 1\r\n") == Approx(81));
  CHECK(area("vn 0 0 1\nvt 0 0\n# comment \\\nf 1 2 3\nf 1/1/1 2/1/1 3/1/1\n") == Approx(40.5));
}

TEST_CASE("a reader of surfaces without memory reports it, and leaves no process or file") {
  const std::ptrdiff_t open_before = OpenFiles();
  if (!test::kUnderSanitizer) {
    MeshReader poor = Quick();
    poor.memory_bytes = std::int64_t{1} << 20;
    CHECK_FALSE(Refusal([&] { ImportMesh(TubeAsObj(), "a.obj", 1, poor); }).empty());
  }
  CHECK(OpenFiles() == open_before);
  CHECK_FALSE(HasChildren());
  CHECK(ImportMesh(TubeAsObj(), "a.obj", 1).triangles.size() == MakeClosedTube().triangles.size());
}

TEST_CASE("a reader of surfaces that has been taken over gets nowhere") {
  const std::ptrdiff_t open_before = OpenFiles();
  const auto refused = [](const std::string& script, const std::string& part) {
    INFO(script);
    const Impostor impostor(script);
    CHECK_THAT(Refusal([&] { impostor.Read(); }), Contains(part));
  };
  refused("kill -SEGV $$", "crashed");
  refused("exit 3", "crashed");
  refused("yes", "more triangles than the file can hold");
  refused("true", "no usable answer");
  refused("printf M", "no usable answer");
  refused("printf '%s' 'Ra.ply: \033[2J'; printf '\\033[2J'", "a.ply: \\x1b[2J");
  TriangleMesh mesh;
  mesh.vertices_mm = {{0, 0, 0}, {9, 0, 0}, {0, 9, 0}};
  mesh.triangles = {{0, 1, 2}};
  CHECK(Impostor(AnswerAsScript(MeshAnswer(mesh))).Read().triangles == mesh.triangles);
  refused(AnswerAsScript(MeshAnswer(mesh)) + "; printf x", "no usable answer");
  for (const int32_t wrong : {-1, 3}) {
    mesh.triangles = {{0, 1, wrong}};
    refused(AnswerAsScript(MeshAnswer(mesh)), "no usable answer");
  }
  mesh.triangles = {{0, 1, 2}};
  mesh.vertices_mm[1].y() = std::nan("");
  refused(AnswerAsScript(MeshAnswer(mesh)), "no usable answer");
  for (const char* const script : {"sleep 100", "exec >&-; sleep 100"}) {
    Impostor impostor(script);
    impostor.reader.clock_s = 0.1;
    CHECK_THAT(Refusal([&] { impostor.Read(); }), Contains("did not end"));
  }
  Impostor missing("");
  missing.reader.program += "s";
  CHECK_THAT(Refusal([&] { missing.Read(); }), Contains("cannot be started"));
  CHECK(OpenFiles() == open_before);
  CHECK_FALSE(HasChildren());
}

TEST_CASE(
    "a reader of surfaces that a limit of processor time ends does not call the file damaged") {
  // The limits are those of a forked process: a hard one cannot be raised again.
  const auto refusal = [](rlim_t soft_s, rlim_t hard_s) {
    int ends[2];
    REQUIRE(pipe(ends) == 0);
    const Impostor busy("while :; do :; done");
    const pid_t child = fork();
    if (child == 0) {
      const rlimit limit{soft_s, hard_s};
      setrlimit(RLIMIT_CPU, &limit);
      MeshReader reader = busy.reader;
      reader.cpu_s = 30;
      const std::string said = Refusal([&] { ImportMesh("", "a.ply", 1, reader); });
      _exit(write(ends[1], said.data(), said.size()) < 0 ? 1 : 0);
    }
    close(ends[1]);
    std::string said(1000, '\0');
    said.resize(static_cast<std::size_t>(std::max<ssize_t>(0, read(ends[0], said.data(), 1000))));
    close(ends[0]);
    waitpid(child, nullptr, 0);
    return said;
  };
  CHECK_THAT(refusal(1, 2), Contains("the 2 s of processor time that a program may take here") &&
                                Contains("(ulimit -t)") && !Contains("damaged"));
  // A hard limit kills at once.
  CHECK_THAT(refusal(1, 1), Contains("the 1 s of processor time") && !Contains("damaged"));
}

TEST_CASE("surfaces are read from several threads at once", "[threads]") {
  const std::string tube = TubeAsObj();
  std::vector<TriangleMesh> read(4);
  {
    std::vector<std::jthread> threads;
    for (TriangleMesh& mesh : read) {
      threads.emplace_back([&mesh, &tube] { mesh = ImportMesh(tube, "a.obj", 1000); });
    }
  }
  for (const TriangleMesh& mesh : read) {
    CHECK(mesh.triangles.size() == MakeClosedTube().triangles.size());
    CHECK(mesh.Bounds().max().x() == Approx(40000));
  }
}

}  // namespace
}  // namespace torquer::vessel
