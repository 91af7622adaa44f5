#include "host/viewer/page_server.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "host/viewer/event_loop.h"
#include "host/viewer/http_request.h"
#include "host/viewer/listening_socket.h"
#include "host/viewer/page_door.h"
#include "host/viewer/page_files.h"
#include "host/viewer/shown_topics.h"

namespace torquer::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::seconds kUnknownTime{2};
constexpr std::chrono::seconds kRequestTime{5};
constexpr std::chrono::seconds kSilentPageTime{10};
constexpr std::chrono::seconds kLeaveTime{1};
constexpr std::size_t kMostMessageBytes = 256;
constexpr char kBusName[] = "bus";

// Reads at a bounded rate, so that no connection blocks the others.
using Stream = beast::basic_stream<tcp, tcp::socket::executor_type, beast::simple_rate_policy>;

struct ServedFile {
  PageServer::ServedAs as;
  std::string content;
};

}  // namespace

class PageServer::Impl {
 public:
  Impl(int listening_socket, const std::string& token, Received received, Left left)
      : received_(std::move(received)),
        left_(std::move(left)),
        acceptor_(loop_.context()),
        pause_(loop_.context()) {
    const std::uint16_t port = PortOf(listening_socket);
    acceptor_.assign(tcp::v4(), listening_socket);
    door_.token = token;
    door_.hosts = {fmt::format("127.0.0.1:{}", port), fmt::format("localhost:{}", port)};
    url_ = fmt::format("http://127.0.0.1:{}/{}/", port, token);
    Accept();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  class Request;
  class Page;

  void Accept() {
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) return PauseAccepting();
      Begin(std::move(socket));
      Accept();
    });
  }

  // Usually EMFILE: retry after a connection closes.
  void PauseAccepting() {
    pause_.expires_after(std::chrono::milliseconds(100));
    pause_.async_wait([this](error_code error) {
      if (!error) Accept();
    });
  }

  void Begin(tcp::socket socket);
  void Show(const std::string& topic, const SharedPageMessage& message);
  void ShowPassing(const std::string& topic, const SharedPageMessage& message);
  void Drop(const std::vector<std::string>& topics);

  Received received_;
  Left left_;
  Door door_;
  std::string url_;
  ShownTopics topics_;
  std::map<std::string, std::shared_ptr<const ServedFile>> served_;
  std::set<Page*> pages_;
  std::list<Request*> unknown_;  // connections without the token, the oldest first
  PageId last_page_ = 0;
  int connections_ = 0;  // that have
  std::int64_t refused_ = 0;
  // Declared last, so destroyed first: pages end with it, and use the members above.
  EventLoop loop_;
  tcp::acceptor acceptor_;
  asio::steady_timer pause_;
};

// An open page, with at most one message in flight, and the newest waiting message of each topic.
class PageServer::Impl::Page : public std::enable_shared_from_this<Page> {
 public:
  Page(Impl& server, Stream stream)
      : server_(server),
        stream_(std::move(stream)),
        id_(++server.last_page_),
        leave_(server.loop_.context()) {
    ++server_.connections_;
    server_.pages_.insert(this);
    waiting_ = server_.topics_.newest();
  }
  ~Page() {
    --server_.connections_;
    server_.pages_.erase(this);
    server_.left_(id_);
  }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  template <class HttpRequest>
  void Begin(const HttpRequest& request) {
    beast::get_lowest_layer(stream_).expires_never();
    error_code ignored;
    (void)beast::get_lowest_layer(stream_).socket().set_option(tcp::no_delay(true), ignored);
    // Pings a silent page, and closes a page that does not answer.
    stream_.set_option(websocket::stream_base::timeout{kRequestTime, kSilentPageTime, true});
    stream_.read_message_max(kMostMessageBytes);
    // Counts pings here, because each costs an answer, and reads do not return them.
    stream_.control_callback([this](websocket::frame_type, beast::string_view) { Count(); });
    stream_.async_accept(request, [self = this->shared_from_this()](error_code error) {
      if (error) {
        // Beast rejects an upgrade without its headers.
        self->server_.refused_ += !HasLeft(error);
        return;
      }
      self->open_ = true;
      self->Read();
      self->Write();
    });
  }

  void Add(const std::string& topic, const SharedPageMessage& message) {
    waiting_[topic] = message;
    Write();
  }
  void Drop(const std::string& topic) { waiting_.erase(topic); }

 private:
  void Read() {
    stream_.async_read(buffer_, [self = this->shared_from_this()](error_code error, std::size_t) {
      if (error) {
        // Beast rejects malformed and oversized frames.
        self->server_.refused_ += !HasLeft(error);
        return self->Close();
      }
      self->Take();
    });
  }

  // Closes a page that sends too many messages, and returns false.
  bool Count() {
    if (rate_.Take(kMostMessagesPerS, std::chrono::steady_clock::now())) return true;
    if (!open_) return false;
    ++server_.refused_;
    CloseFor(fmt::format("more than {} messages a second", kMostMessagesPerS));
    return false;
  }

  void Take() {
    const auto bytes = buffer_.cdata();
    if (!Count()) return;
    bool good = stream_.got_binary();
    server_.loop_.Guarded([&] {
      good = good &&
             server_.received_(id_, {static_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
    });
    buffer_.consume(buffer_.size());
    if (good) return Read();
    ++server_.refused_;
    Say("not a message of this page");
    Close();
  }

  void Write() {
    if (!open_ || writing_ || waiting_.empty()) return;
    // Sends topics in turn, so that no topic blocks others.
    auto next = waiting_.upper_bound(last_topic_);
    if (next == waiting_.end()) next = waiting_.begin();
    last_topic_ = next->first;
    sent_ = std::move(next->second);
    waiting_.erase(next);
    writing_ = true;
    stream_.text(sent_->text);
    stream_.async_write(asio::buffer(sent_->content),
                        [self = this->shared_from_this()](error_code error, std::size_t) {
                          self->writing_ = false;
                          if (error) return self->Close();
                          self->Write();
                        });
  }

  void Say(const std::string& reason) {
    tcp::socket& socket = beast::get_lowest_layer(stream_).socket();
    error_code ignored;
    (void)socket.non_blocking(true, ignored);
    (void)socket.send(asio::buffer(CloseFrame(reason)), 0, ignored);
  }

  // Closing waits for the message in flight, so that the reason arrives after it. Until then no
  // message is read.
  void CloseFor(const std::string& reason) {
    open_ = false;
    leaves_ = true;
    Say(reason);
    error_code ignored;
    (void)beast::get_lowest_layer(stream_).socket().shutdown(tcp::socket::shutdown_send, ignored);
    leave_.expires_after(kLeaveTime);
    leave_.async_wait([self = this->shared_from_this()](error_code) {
      self->leaves_ = false;
      self->Close();
    });
  }

  void Close() {
    if (leaves_) return;
    open_ = false;
    error_code ignored;
    (void)beast::get_lowest_layer(stream_).socket().close(ignored);
  }

  Impl& server_;
  websocket::stream<Stream> stream_;
  const PageId id_;
  beast::flat_static_buffer<2 * kMostMessageBytes> buffer_;
  std::map<std::string, SharedPageMessage> waiting_;
  std::string last_topic_;
  SharedPageMessage sent_;
  bool open_ = false;
  bool writing_ = false;
  bool leaves_ = false;
  asio::steady_timer leave_;
  MessageRate rate_;
};

// A connection's one request.
class PageServer::Impl::Request : public std::enable_shared_from_this<Request> {
 public:
  Request(Impl& server, tcp::socket socket) : server_(server), stream_(std::move(socket)) {
    place_ = server_.unknown_.insert(server_.unknown_.end(), this);
    stream_.rate_policy().read_limit(kMostReadBytesPerS);
    parser_.header_limit(kMostHeaderBytes);
    parser_.body_limit(0);
  }
  ~Request() {
    LeaveUnknown();
    if (known_) --server_.connections_;
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;

  void Begin() {
    stream_.expires_after(kUnknownTime);
    http::async_read(stream_, buffer_, parser_,
                     [self = this->shared_from_this()](error_code error, std::size_t) {
                       if (error == http::error::end_of_stream) return;
                       if (error) {
                         ++self->server_.refused_;
                         return;
                       }
                       self->Answer();
                     });
  }

  // The pending read or write ends with an error.
  void Close() {
    LeaveUnknown();
    error_code ignored;
    (void)stream_.socket().close(ignored);
  }

 private:
  void Answer() {
    const auto& request = parser_.get();
    const auto [status, name] = server_.door_.Open(VisitorOf(request));
    if (static_cast<http::status>(status) != http::status::ok) {
      return Refuse(static_cast<http::status>(status));
    }
    if (server_.connections_ >= kMostConnections) return Refuse(http::status::service_unavailable);
    Admit();
    if (name == kBusName) {
      if (!websocket::is_upgrade(request)) return Refuse(http::status::upgrade_required);
      // Beast accepts an empty key. A valid key is 16 bytes in base64.
      const std::size_t key_size = request[http::field::sec_websocket_key].size();
      if (key_size != 24) return Refuse(http::status::bad_request);
      if (static_cast<int>(server_.pages_.size()) >= kMostPages) {
        return Refuse(http::status::service_unavailable);
      }
      return std::make_shared<Page>(server_, std::move(stream_))->Begin(request);
    }
    if (const auto served = server_.served_.find(name); served != server_.served_.end()) {
      file_ = served->second;
      const bool document = file_->as == ServedAs::kDocument;
      if (document) policy_ = kDocumentPolicy;
      return SendFile(document ? "text/html; charset=utf-8" : "image/jpeg", file_->content);
    }
    const auto files = PageFiles();
    const auto file = std::find_if(files.begin(), files.end(),
                                   [&name = name](const PageFile& f) { return f.name == name; });
    if (file == files.end()) return Refuse(http::status::not_found);
    SendFile(file->type, file->content);
  }

  void Admit() {
    LeaveUnknown();
    known_ = true;
    ++server_.connections_;
    stream_.expires_after(kRequestTime);
  }

  void LeaveUnknown() {
    if (place_ != server_.unknown_.end()) server_.unknown_.erase(place_);
    place_ = server_.unknown_.end();
  }

  void SendFile(std::string_view type, std::string_view content) {
    answer_.set(http::field::content_type, boost::beast::string_view(type.data(), type.size()));
    answer_.body() = {content.data(), content.size()};
    Send(http::status::ok);
  }

  void Refuse(http::status status) {
    ++server_.refused_;
    Send(status);
  }

  void Send(http::status status) {
    answer_.result(status);
    answer_.keep_alive(false);
    answer_.set("Content-Security-Policy", policy_);
    answer_.set(http::field::cache_control, "no-store");
    answer_.set("Cross-Origin-Resource-Policy", "same-origin");
    answer_.set("Referrer-Policy", "no-referrer");
    answer_.set("X-Content-Type-Options", "nosniff");
    answer_.prepare_payload();
    http::async_write(stream_, answer_, [self = this->shared_from_this()](error_code, std::size_t) {
      error_code ignored;
      (void)self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  Impl& server_;
  Stream stream_;
  bool known_ = false;  // it has shown the token
  std::list<Request*>::iterator place_;
  beast::flat_static_buffer<kMostHeaderBytes> buffer_;
  http::request_parser<http::empty_body> parser_;
  std::shared_ptr<const ServedFile> file_;  // while it is sent
  const char* policy_ = kPagePolicy;
  http::response<http::span_body<const char>> answer_;
};

// Accepts the newest connection and closes the oldest one without the token. A page sends its token
// at once.
void PageServer::Impl::Begin(tcp::socket socket) {
  if (unknown_.size() >= kMostUnknown) unknown_.front()->Close();
  std::make_shared<Request>(*this, std::move(socket))->Begin();
}

// A page that has been closed leaves the set in its destructor, not here.
void PageServer::Impl::Show(const std::string& topic, const SharedPageMessage& message) {
  topics_.Show(topic, message);
  for (Page* page : pages_) page->Add(topic, message);
}

void PageServer::Impl::ShowPassing(const std::string& topic, const SharedPageMessage& message) {
  Drop(topics_.ShowPassing(topic, message, std::chrono::steady_clock::now()));
  for (Page* page : pages_) page->Add(topic, message);
}

void PageServer::Impl::Drop(const std::vector<std::string>& topics) {
  for (Page* page : pages_) {
    for (const std::string& topic : topics) page->Drop(topic);
  }
}

PageServer::PageServer(int listening_socket, const std::string& token, Received received, Left left)
    : impl_(std::make_unique<Impl>(listening_socket, token, std::move(received), std::move(left))) {
}

PageServer::~PageServer() = default;

const std::string& PageServer::url() const { return impl_->url_; }
std::int64_t PageServer::refused() const { return impl_->refused_; }
int PageServer::pages() const { return static_cast<int>(impl_->pages_.size()); }

void PageServer::ShowText(const std::string& topic, std::string text) {
  impl_->Show(topic, std::make_shared<const PageMessage>(PageMessage{std::move(text), true}));
}

void PageServer::ShowBytes(const std::string& topic, std::string bytes) {
  impl_->Show(topic, std::make_shared<const PageMessage>(PageMessage{std::move(bytes), false}));
}

void PageServer::ShowPassingText(const std::string& topic, std::string text) {
  impl_->ShowPassing(topic,
                     std::make_shared<const PageMessage>(PageMessage{std::move(text), true}));
}

void PageServer::Forget(const std::string& topic) { impl_->topics_.Forget(topic); }

void PageServer::Serve(const std::string& name, ServedAs as, std::string content) {
  if (content.empty()) {
    impl_->served_.erase(name);
  } else {
    impl_->served_[name] = std::make_shared<const ServedFile>(ServedFile{as, std::move(content)});
  }
}

void PageServer::WhenReadable(int file_descriptor, std::function<void()> act) {
  impl_->loop_.WhenReadable(file_descriptor, std::move(act));
}

void PageServer::Every(std::chrono::milliseconds interval, std::function<void()> act) {
  impl_->loop_.Every(interval, std::move(act));
}

void PageServer::Run() { impl_->loop_.Run(); }
void PageServer::Stop() { impl_->loop_.Stop(); }

}  // namespace torquer::viewer
