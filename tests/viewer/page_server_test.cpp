#include "host/viewer/page_server.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <random>
#include <thread>

#include "host/viewer/page_files.h"
#include "host/viewer/shown_topics.h"
#include "tests/support/raw_client.h"
#include "tests/support/sanitizer.h"
#include "tests/viewer/served_page.h"

using namespace torquer::viewer;
using namespace torquer::test;

TEST_CASE("Only the page's files are served, below the token") {
  const Served served;
  CHECK(served.Get("/" + kToken + "/") == 200);
  for (const PageFile& file : PageFiles()) {
    CHECK(served.Get("/" + kToken + "/" + std::string(file.name)) == 200);
  }
  const std::string inside = "/" + kToken + "/";
  for (const char* path :
       {"../page.js", "..%2fpage.js", "./page.js", "//page.js", "page.js/", "page.js?",
        "../../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "PAGE.JS", "page"}) {
    CHECK(served.Get(inside + path) == 404);
  }
  for (const char* path : {"/", "/page.js", "/etc/passwd", "/../etc/passwd", "*", "http://x/"}) {
    CHECK(served.Get(path) == 403);
  }
  CHECK(served.Get("/" + kToken.substr(1) + "0/") == 403);
  CHECK(served.Get("/" + kToken) == 403);
  CHECK(served.Get(served.Bus()) == 426);
}

TEST_CASE("A document of another program may have only styles, and can be removed") {
  std::atomic<int> step = 0;
  const Served served([&step](PageServer& server) {
    const int now = step.exchange(0);
    if (now == 1) {
      server.Serve("report.html", PageServer::ServedAs::kDocument, "<script>alert(1)</script>");
      server.Serve("cases/a b.jpg", PageServer::ServedAs::kPicture, "JPEG");
    } else if (now == 2) {
      server.Serve("report.html", PageServer::ServedAs::kDocument, "another");
    } else if (now == 3) {
      server.Serve("report.html", PageServer::ServedAs::kDocument, "");
    }
  });
  const auto get = [&served](const std::string& name) {
    const RawClient client(served.port);
    client.Send("GET /" + kToken + "/" + name + " HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n");
    return client.ReadAll();
  };
  const auto go = [&step](int to) {
    step = to;
    return Served::Soon([&step] { return step == 0; });
  };
  CHECK(StatusOf(get("report.html")) == 404);
  REQUIRE(go(1));
  const std::string document = get("report.html");
  CHECK(StatusOf(document) == 200);
  CHECK_THAT(document, Catch::EndsWith("\r\n\r\n<script>alert(1)</script>") &&
                           Catch::Contains("Content-Type: text/html; charset=utf-8\r\n") &&
                           Catch::Contains("default-src 'none'; style-src 'unsafe-inline'") &&
                           Catch::Contains("; sandbox\r\n") && !Catch::Contains("script-src"));
  const std::string picture = get("cases/a b.jpg");
  CHECK(StatusOf(picture) == 0);  // a space ends the name, so this is not a request
  CHECK(served.Get("/report.html") == 403);
  CHECK(served.Get("/" + kToken + "/cases/") == 404);
  REQUIRE(go(2));
  CHECK_THAT(get("report.html"), Catch::EndsWith("\r\n\r\nanother"));
  REQUIRE(go(3));
  CHECK(StatusOf(get("report.html")) == 404);
}

TEST_CASE("Another host, origin or method is refused") {
  const Served served;
  const std::string page = "/" + kToken + "/";
  const auto answer = [&](const std::string& request) {
    const RawClient client(served.port);
    client.Send(request);
    return StatusOf(client.ReadAll());
  };
  CHECK(answer("GET " + page + " HTTP/1.1\r\nHost: localhost:" + std::to_string(served.port) +
               "\r\n\r\n") == 200);
  // A name that a DNS server may resolve to this machine.
  CHECK(answer("GET " + page + " HTTP/1.1\r\nHost: evil.example:" + std::to_string(served.port) +
               "\r\n\r\n") == 421);
  CHECK(answer("GET " + page + " HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n") == 421);
  CHECK(answer("GET " + page + " HTTP/1.1\r\n\r\n") == 421);
  CHECK(answer("GET " + page + " HTTP/1.1\r\nHost: " + served.host +
               "\r\nHost: evil.example\r\n\r\n") == 421);
  CHECK(answer("POST " + page + " HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n") == 405);
  CHECK(served.Get(page, "Origin: " + served.Origin() + "\r\n") == 200);
  CHECK(served.Get(page, "Origin: http://evil.example\r\n") == 403);
  CHECK(served.Get(page, "Origin: null\r\n") == 403);
  CHECK_FALSE(RawClient(served.port).Upgrade(served.Bus(), served.host, "http://evil.example"));
  CHECK_FALSE(RawClient(served.port).Upgrade(served.Bus(), served.host, ""));
  CHECK_FALSE(RawClient(served.port)
                  .Upgrade("/" + std::string(32, '0') + "/bus", served.host, served.Origin()));
  CHECK(RawClient(served.port).Upgrade(served.Bus(), served.host, served.Origin()));
}

TEST_CASE("Invalid requests are refused, and the server continues") {
  Served served;
  std::mt19937 random(3);
  const int rounds = Rounds(8000, 8);
  const std::vector<std::string> seeds = {
      "GET /" + kToken + "/ HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n",
      "GET " + served.Bus() + " HTTP/1.1\r\nHost: " + served.host +
          "\r\nOrigin: " + served.Origin() +
          "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"};
  for (int i = 0; i < rounds; ++i) {
    std::string request = seeds[random() % seeds.size()];
    for (unsigned changes = 1 + random() % 4; changes > 0; --changes) {
      request[random() % request.size()] = static_cast<char>(random());
    }
    if (random() % 8 == 0) request.resize(random() % request.size());
    const RawClient client(served.port);
    client.Send(request);
    client.Finish();
    client.ReadAll();
  }
  {
    const RawClient large(served.port);
    large.Send("GET /" + std::string(100'000, 'a') + " HTTP/1.1\r\n\r\n");
    CHECK(StatusOf(large.ReadAll()) != 200);
    const RawClient body(served.port);
    body.Send("GET /" + kToken + "/ HTTP/1.1\r\nHost: " + served.host +
              "\r\nContent-Length: 1000000\r\n\r\n");
    CHECK(StatusOf(body.ReadAll()) != 200);
  }
  CHECK(served.refused > 0);
  CHECK(Served::Soon([&] { return served.Get("/" + kToken + "/") == 200; }));
}

TEST_CASE("A page that sends an invalid message is closed") {
  const Served served;
  const auto send = [&](int opcode, const std::string& content) {
    RawClient client(served.port);
    REQUIRE(client.Upgrade(served.Bus(), served.host, served.Origin()));
    client.SendFrame(opcode, content);
    return client.Closed();
  };
  CHECK(send(2, "12345"));
  CHECK(send(1, "1234"));
  CHECK(send(2, std::string(100'000, 'x')));
  CHECK(send(7, "1234"));  // unknown kind of frame
  {
    RawClient unmasked(served.port);
    REQUIRE(unmasked.Upgrade(served.Bus(), served.host, served.Origin()));
    unmasked.Send(
        "\x82\x04"
        "1234");
    CHECK(unmasked.Closed());
    RawClient flood(served.port);
    REQUIRE(flood.Upgrade(served.Bus(), served.host, served.Origin()));
    for (int i = 0; i < 2 * PageServer::kMostMessagesPerS; ++i) flood.SendFrame(2, "1234");
    CHECK(flood.Closed());
  }
  CHECK(Served::Soon([&] { return served.pages == 0; }));
  CHECK(served.left == 6);
}

TEST_CASE("Pages and connections beyond the limits are refused, and those before them stay") {
  const Served served;
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < PageServer::kMostPages; ++i) {
    clients.push_back(std::make_unique<RawClient>(served.port));
    REQUIRE(clients.back()->Upgrade(served.Bus(), served.host, served.Origin()));
  }
  CHECK_FALSE(RawClient(served.port).Upgrade(served.Bus(), served.host, served.Origin()));
  clients.front()->SendFrame(2, "1234");
  CHECK(Served::Soon([&] { return served.received == 1; }));
  CHECK(served.Get("/" + kToken + "/") == 200);
}

TEST_CASE("Silent connections do not block pages with the token, and the oldest is closed first") {
  const Served served;
  std::vector<std::unique_ptr<RawClient>> silent;
  const auto add_silent = [&] {
    for (int i = 0; i < 100; ++i) silent.push_back(std::make_unique<RawClient>(served.port));
  };
  add_silent();
  CHECK(silent.front()->Closed());
  CHECK(served.Get("/" + kToken + "/") == 200);
  RawClient page(served.port);
  REQUIRE(page.Upgrade(served.Bus(), served.host, served.Origin()));
  add_silent();
  CHECK(served.Get("/" + kToken + "/") == 200);
  page.SendFrame(2, "1234");
  CHECK(Served::Soon([&] { return served.received == 1; }));
  // The server does not wait long for any silent client.
  CHECK(silent.back()->Closed());
}

namespace {

// Page that repeats the same frames in its own thread.
class Flood {
 public:
  // `first` and `then` are the first byte of the first frame and of the others.
  Flood(const Served& served, int first, int then, const std::string& content)
      : client_(served.port) {
    REQUIRE(client_.Upgrade(served.Bus(), served.host, served.Origin()));
    client_.Send(Frame(first, content));
    std::string frames;
    for (int i = 0; i < 2000; ++i) frames += Frame(then, content);
    thread_ = std::thread([this, frames] {
      while (client_.Send(frames)) ++sent;
    });
  }
  ~Flood() {
    client_.Finish();
    thread_.join();
  }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

  RawClient& client() { return client_; }

  std::atomic<int> sent = 0;

 private:
  static std::string Frame(int first, const std::string& content) {
    std::string frame(1, static_cast<char>(first));
    frame += static_cast<char>(0x80 | content.size());
    return frame + std::string(4, '\0') + content;
  }

  RawClient client_;
  std::thread thread_;
};

// Shows a state once the reading page has the previous one.
class Lockstep {
 public:
  Lockstep()
      : served([this](PageServer& server) {
          if (seen_ == shown_) server.ShowBytes("state", std::to_string(++shown_));
        }),
        page_(served.port) {
    REQUIRE(page_.Upgrade(served.Bus(), served.host, served.Origin()));
  }
  // Reads `states` states; false on timeout.
  bool Read(int states) {
    for (; states > 0; --states) {
      const auto state = page_.Next();
      if (!state) return false;
      seen_ = std::stoi(state->content);
    }
    return true;
  }

 private:
  std::atomic<int> shown_ = 0;
  std::atomic<int> seen_ = 0;

 public:
  Served served;

 private:
  RawClient page_;
};

}  // namespace

TEST_CASE("A page that sends messages or pings without end is cut off with the reason") {
  const auto [first, content] =
      GENERATE(table<int, std::string>({{0x82, "1234"}, {0x89, ""}, {0x8a, "x"}}));
  CAPTURE(first);
  Lockstep good;
  Flood flood(good.served, first, first, content);
  CHECK(good.Read(300));
  CHECK(Served::Soon([&] { return good.served.pages == 1; }));
  int answers = 0;
  std::string reason;
  while (const auto message = flood.client().Next()) {
    answers += message->opcode == 10;
    if (message->opcode == 8) reason = message->content.substr(2);
  }
  CHECK(reason == "more than 400 messages a second");
  CHECK(answers <= PageServer::kMostMessagesPerS);
  CHECK(good.served.received <= PageServer::kMostMessagesPerS);
  CHECK(good.Read(10));
}

TEST_CASE("An endless message blocks only the page that sends it") {
  Lockstep good;
  Flood flood(good.served, 0x02, 0x00, "");
  // The server reads so slowly that the sender blocks while the other page gets its states.
  bool waits = false;
  for (int k = 0; k < 200 && !waits; ++k) {
    const int before = flood.sent;
    REQUIRE(good.Read(50));
    waits = flood.sent == before;
  }
  CHECK(waits);
}

TEST_CASE("A slow page misses old states, never the newest, and does not delay others") {
  static constexpr int kLast = 600;
  std::atomic<int> shown = -1;
  const Served served([&shown](PageServer& server) {
    if (shown >= kLast) return;
    ++shown;
    server.ShowBytes("state", std::to_string(shown) + " " + std::string(60'000, 'x'));
    server.ShowText("health", "text " + std::to_string(shown));
  });
  RawClient slow(served.port, 4096);
  REQUIRE(slow.Upgrade(served.Bus(), served.host, served.Origin()));
  RawClient quick(served.port);
  REQUIRE(quick.Upgrade(served.Bus(), served.host, served.Origin()));
  const auto read_on = [&](RawClient& client) {
    int states = 0;
    int last = -1;
    bool text = false;
    while (last < kLast || !text) {
      const auto message = client.Next();
      if (!message) break;
      if (message->opcode == 1) {
        text = message->content == "text " + std::to_string(kLast);
        continue;
      }
      const int number = std::stoi(message->content);
      CHECK(number > last);
      last = number;
      ++states;
    }
    CHECK(last == kLast);
    CHECK(text);
    return states;
  };
  const int quick_states = read_on(quick);
  CHECK(Served::Soon([&] { return shown == kLast; }));
  // The slow page gets only the kernel's buffered states, and the newest.
  CHECK(read_on(slow) < quick_states / 2);
}

TEST_CASE("A late page gets the newest messages") {
  std::atomic<bool> done = false;
  std::atomic<bool> go_on = false;
  std::atomic<bool> forget = false;
  const Served served([&done, &go_on, &forget](PageServer& server) {
    if (go_on.exchange(false)) server.ShowText("scene", "third");
    if (forget) server.Forget("scene");
    forget = false;
    if (done.exchange(true)) return;
    server.ShowText("scene", "first");
    server.ShowText("scene", "second");
    for (int i = 0; i < 1000; ++i) server.ShowPassingText("topic " + std::to_string(i), "x");
  });
  constexpr std::size_t kShown = 1 + ShownTopics::kMostPassing;
  REQUIRE(Served::Soon([&] { return done.load(); }));
  RawClient client(served.port);
  REQUIRE(client.Upgrade(served.Bus(), served.host, served.Origin()));
  int second = 0;
  for (std::size_t i = 0; i < kShown; ++i) {
    const auto message = client.Next();
    REQUIRE(message);
    second += message->content == "second";
    CHECK(message->content != "first");
  }
  CHECK(second == 1);
  // A forgotten topic is not sent to pages that connect later.
  forget = true;
  REQUIRE(Served::Soon([&] { return !forget; }));
  RawClient later(served.port);
  REQUIRE(later.Upgrade(served.Bus(), served.host, served.Origin()));
  for (std::size_t i = 1; i < kShown; ++i) {
    const auto message = later.Next();
    REQUIRE(message);
    CHECK(message->content != "second");
  }
  // No topic beyond the limit is queued before it.
  go_on = true;
  const auto next = client.Next();
  REQUIRE(next);
  CHECK(next->content == "third");
}
