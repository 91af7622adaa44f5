#include "host/viewer/page_door.h"

#include <algorithm>

namespace torquer::viewer {
namespace {

constexpr unsigned kForbidden = 403;
constexpr unsigned kMethodNotAllowed = 405;
constexpr unsigned kMisdirected = 421;

// Compares in a time that does not depend on the first difference.
bool Equal(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different |= static_cast<unsigned>(a[i] ^ b[i]);
  return different == 0;
}

}  // namespace

Door::Answer Door::Open(const Visitor& visitor) const {
  const auto is_host = [this](std::string_view host) {
    return std::find(hosts.begin(), hosts.end(), host) != hosts.end();
  };
  if (visitor.hosts != 1 || !is_host(visitor.host)) return {kMisdirected, ""};
  constexpr std::string_view kScheme = "http://";
  const bool own = visitor.origins == 1 && visitor.origin.substr(0, kScheme.size()) == kScheme &&
                   is_host(visitor.origin.substr(kScheme.size()));
  if (!own && (visitor.upgrade || visitor.origins > 0)) return {kForbidden, ""};
  if (visitor.method != "GET") return {kMethodNotAllowed, ""};
  const std::string_view target = visitor.target;
  const std::size_t end = token.size() + 2;
  if (target.size() < end || target[0] != '/' || target[end - 1] != '/' ||
      !Equal(target.substr(1, token.size()), token)) {
    return {kForbidden, ""};
  }
  return {.name = std::string(target.substr(end))};
}

bool MessageRate::Take(int most, std::chrono::steady_clock::time_point now) {
  if (now - since_ > std::chrono::seconds(1)) {
    since_ = now;
    messages_ = 0;
  }
  return ++messages_ <= most;
}

std::string CloseFrame(std::string_view reason) {
  constexpr char kFinalClose = '\x88';
  constexpr unsigned kPolicyViolation = 1008;
  std::string frame = {kFinalClose, static_cast<char>(2 + reason.size()),
                       static_cast<char>(kPolicyViolation >> 8),
                       static_cast<char>(kPolicyViolation & 0xff)};
  return frame.append(reason);
}

}  // namespace torquer::viewer
