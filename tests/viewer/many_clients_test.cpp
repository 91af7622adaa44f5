// Page server with many simultaneous clients: friendly, stalled and hostile ones.
#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/raw_client.h"
#include "tests/support/sanitizer.h"
#include "tests/viewer/served_page.h"

using namespace torquer::viewer;
using namespace torquer::test;

namespace {

constexpr char kMask[] = {0, 0, 0, 0};

// Page that reads states in its own thread; a state is a number with padding.
class Reader {
 public:
  explicit Reader(const Served& served) : client_(served.port) {
    REQUIRE(client_.Upgrade(served.Bus(), served.host, served.Origin()));
  }
  ~Reader() {
    if (thread_.joinable()) thread_.join();
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  void ReadUntil(int last_number) {
    last_number_ = last_number;
    thread_ = std::thread([this] {
      while (last < last_number_) {
        const auto message = client_.Next();
        if (!message) return;
        const int number = std::stoi(message->content);
        if (number != last + 1) ++jumps;
        last = number;
      }
    });
  }
  /// Stops after the next state.
  void End() { last_number_ = -1; }
  void SendMessage() { client_.SendFrame(2, "1234"); }

  std::atomic<int> last = -1;
  std::atomic<int> jumps = 0;

 private:
  RawClient client_;
  std::atomic<int> last_number_ = -1;
  std::thread thread_;
};

// Hostile connections one after the other, with random kind and content. Returns the name of the
// kind, preceded by "!" if the server failed.
class Attacker {
 public:
  Attacker(const Served& served, unsigned seed) : served_(served), random_(seed) {
    const std::string page = "/" + kToken + "/";
    Add("traversal", [this, page] {
      static const std::vector<std::string> steps = {"../",  "..%2f", "%2e%2e/", "./",    "//",
                                                     "..\\", "%00",   "..;/",    "....//"};
      std::string path = page;
      for (auto k = 1 + random_() % 6; k > 0; --k) path += steps[random_() % steps.size()];
      return Get(path + (random_() % 2 == 0 ? "etc/passwd" : "page.js"), served_.host, "") == 404;
    });
    Add("origin",
        [this, page] { return Get(page, served_.host, "Origin: " + Elsewhere() + "\r\n") == 403; });
    Add("host", [this, page] { return Get(page, Elsewhere().substr(7), "") == 421; });
    Add("no token", [this] { return Get("/" + Word(random_() % 20), served_.host, "") == 403; });
    Add("token", [this] {
      std::string token = kToken;
      token[random_() % token.size()] ^= static_cast<char>(1 + random_() % 7);
      return Get("/" + token + "/", served_.host, "") == 403;
    });
    Add("method", [this, page] {
      static const std::vector<std::string> methods = {"POST",  "PUT",     "DELETE", "HEAD",
                                                       "PATCH", "OPTIONS", "TRACE",  "BREW"};
      const std::string& method = methods[random_() % methods.size()];
      const int status =
          Ask(method + " " + page + " HTTP/1.1\r\nHost: " + served_.host + "\r\n\r\n");
      return method == "BREW" ? status != 200 : status == 405;
    });
    Add("large header", [this, page] {
      const std::size_t bytes = PageServer::kMostHeaderBytes + random_() % 60'000;
      return Get(page, served_.host, "X-" + Word(8) + ": " + std::string(bytes, 'a') + "\r\n") !=
             200;
    });
    Add("body", [this, page] {
      return Get(page, served_.host,
                 "Content-Length: " + std::to_string(1 + random_() % 1'000'000) + "\r\n") != 200;
    });
    Add("half a request", [this, page] {
      std::string request = "GET " + page + " HTTP/1.1\r\nHost: " + served_.host + "\r\n\r\n";
      request.resize(1 + random_() % (request.size() - 2));
      return Ask(request, true) != 200;
    });
    Add("no upgrade", [this] { return Get(served_.Bus(), served_.host, "") == 426; });
    Add("upgrade from elsewhere", [this] {
      RawClient client(served_.port);
      return !client.Upgrade(served_.Bus(), served_.host, random_() % 2 == 0 ? "" : Elsewhere());
    });
    Add("upgrade without its headers", [this] {
      static const std::vector<std::string> unusable = {
          "", "Sec-WebSocket-Version: 13\r\n", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
          "Sec-WebSocket-Version: 12\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
          "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: \r\n"};
      const int status =
          Get(served_.Bus(), served_.host,
              "Origin: " + served_.Origin() + "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
                  unusable[random_() % unusable.size()]);
      return status == 400 || status == 426;
    });
    Add("text", [this] { return Frame(Framed(0x81, 4, Word(4))); });
    Add("not masked", [this] { return Frame("\x82\x04" + Word(4)); });
    Add("another length", [this] {
      const std::size_t bytes = random_() % 2 == 0 ? random_() % 4 : 5 + random_() % 250;
      return Frame(Framed(0x82, bytes, Word(bytes)));
    });
    Add("large frame", [this] {
      const std::size_t bytes = 300 + random_() % 60'000;
      return Frame(Framed(0x82, bytes, Word(bytes)));
    });
    Add("length without end", [this] {
      return Frame("\x82\xff" + std::string(8, static_cast<char>(0xff)) + std::string(kMask, 4));
    });
    Add("opcode", [this] {
      static constexpr int kReserved[] = {3, 4, 5, 6, 7, 11, 12, 13, 14, 15};
      return Frame(Framed(0x80 | kReserved[random_() % 10], 4, Word(4)));
    });
    Add("reserved bits", [this] {
      return Frame(Framed(0x82 | static_cast<int>(0x10 * (1 + random_() % 7)), 4, Word(4)));
    });
    Add("continuation of nothing", [this] { return Frame(Framed(0x80, 4, Word(4))); });
    Add("large ping", [this] { return Frame(Framed(0x89, 200, Word(200))); });
    Add("ping in parts", [this] { return Frame(Framed(0x09, 4, Word(4))); });
  }

  std::string Attack() {
    const auto& [name, act] = kinds_[random_() % kinds_.size()];
    return act() ? name : "!" + name;
  }
  std::size_t kinds() const { return kinds_.size(); }

 private:
  void Add(const std::string& name, std::function<bool()> act) {
    kinds_.emplace_back(name, std::move(act));
  }
  std::string Word(std::size_t size) {
    std::string word(size, ' ');
    for (char& letter : word) letter = static_cast<char>('a' + random_() % 26);
    return word;
  }
  std::string Elsewhere() {
    static const std::vector<std::string> places = {"http://evil.example", "http://127.0.0.1",
                                                    "http://127.0.0.1.evil.example:80",
                                                    "http://localhost.:1", "http://[::1]:8080"};
    return places[random_() % places.size()];
  }
  int Ask(const std::string& request, bool finish = false) const {
    const RawClient client(served_.port);
    client.Send(request);
    if (finish) client.Finish();
    return StatusOf(client.ReadAll());
  }
  int Get(const std::string& target, const std::string& host, const std::string& more) const {
    return Ask("GET " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n");
  }
  // Masked frame whose first byte is `first`.
  static std::string Framed(int first, std::size_t size, const std::string& content) {
    std::string frame(1, static_cast<char>(first));
    if (size < 126) {
      frame += static_cast<char>(0x80 | size);
    } else {
      frame += static_cast<char>(0x80 | 126);
      frame += static_cast<char>(size >> 8);
      frame += static_cast<char>(size);
    }
    return frame + std::string(kMask, 4) + content;
  }
  // True if the server disconnects a page that sends these bytes.
  bool Frame(const std::string& bytes) const {
    RawClient client(served_.port);
    if (!client.Upgrade(served_.Bus(), served_.host, served_.Origin())) return false;
    client.Send(bytes);
    return client.Closed();
  }

  const Served& served_;
  std::mt19937 random_;
  std::vector<std::pair<std::string, std::function<bool()>>> kinds_;
};

}  // namespace

TEST_CASE("Nine of ten pages get every state while one is stalled, and that one gets the newest") {
  static constexpr int kLast = 300;
  std::atomic<int> shown = -1;
  std::atomic<bool> go_on = false;
  const Served served([&shown, &go_on](PageServer& server) {
    if (!go_on.exchange(false)) return;
    ++shown;
    server.ShowBytes("state", std::to_string(shown) + " " + std::string(60'000, 'x'));
  });
  RawClient stalled(served.port, 4096);
  REQUIRE(stalled.Upgrade(served.Bus(), served.host, served.Origin()));
  std::vector<std::unique_ptr<Reader>> readers;
  for (int i = 0; i < 9; ++i) readers.push_back(std::make_unique<Reader>(served));
  REQUIRE(Served::Soon([&] { return served.pages == 10; }));
  for (const auto& reader : readers) reader->ReadUntil(kLast);
  // A state is shown once all readers have the previous one; 18 MB bypass the stalled page.
  for (int number = 0; number <= kLast; ++number) {
    go_on = true;
    REQUIRE(Served::Soon([&] {
      return std::all_of(readers.begin(), readers.end(),
                         [number](const auto& reader) { return reader->last >= number; });
    }));
  }
  for (const auto& reader : readers) CHECK(reader->jumps == 0);
  CHECK(served.pages == 10);
  int last = -1;
  int states = 0;
  while (last < kLast) {
    const auto message = stalled.Next();
    REQUIRE(message);
    last = std::stoi(message->content);
    ++states;
  }
  // The stalled page gets the kernel's buffered states, and the newest.
  CHECK(states < kLast / 2);
}

TEST_CASE(
    "Ten thousand hostile requests and frames are refused and counted; an open page continues") {
  std::atomic<int> shown = -1;
  std::atomic<int> seen = -1;
  const Served served([&shown, &seen](PageServer& server) {
    if (seen < shown) return;
    ++shown;
    server.ShowBytes("state", std::to_string(shown) + " " + std::string(2000, 'x'));
  });
  Reader good(served);
  good.ReadUntil(std::numeric_limits<int>::max());
  // True if the page gets another state and the server accepts its message.
  int sent = 0;
  const auto goes_on = [&] {
    const int before = good.last;
    seen = before;
    good.SendMessage();
    ++sent;
    return Served::Soon([&] { return good.last > before && served.received > sent - 1; });
  };
  constexpr unsigned kSeed = 20;
  CAPTURE(kSeed);
  Attacker attacker(served, kSeed);
  std::map<std::string, int> outcomes;
  const int attacks = Rounds(10'000, 10);
  for (int i = 0; i < attacks; ++i) {
    ++outcomes[attacker.Attack()];
    CAPTURE(i);
    if (i % 50 == 0) REQUIRE(goes_on());
  }
  CAPTURE(outcomes);
  // Every kind occurred, and no name begins with "!", which would sort first.
  CHECK(outcomes.size() == attacker.kinds());
  CHECK(outcomes.begin()->first.front() != '!');
  CHECK(Served::Soon([&] { return served.refused >= attacks && served.pages == 1; }));
  CHECK(served.refused == attacks);
  CHECK(good.jumps == 0);
  CHECK(served.Get("/" + kToken + "/") == 200);
  good.End();
  CHECK(goes_on());
}
