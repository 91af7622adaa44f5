// Conversions of Boost.Beast's requests and errors, for page_server.cpp alone.
#pragma once

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <string_view>

#include "host/viewer/page_door.h"

namespace torquer::viewer {

/// True if the other end is gone or silent, and no request was refused.
inline bool HasLeft(const boost::system::error_code& error) {
  namespace asio = boost::asio;
  namespace beast = boost::beast;
  namespace websocket = beast::websocket;
  return error == websocket::error::closed || error == asio::error::eof ||
         error == asio::error::connection_reset || error == asio::error::operation_aborted ||
         error == beast::error::timeout;
}

inline std::string_view View(boost::beast::string_view text) { return {text.data(), text.size()}; }

/// Converts a request of Beast for PageDoor.
template <class Request>
Visitor VisitorOf(const Request& request) {
  namespace http = boost::beast::http;
  return {.method = View(request.method_string()),
          .target = View(request.target()),
          .hosts = request.count(http::field::host),
          .host = View(request[http::field::host]),
          .origins = request.count(http::field::origin),
          .origin = View(request[http::field::origin]),
          .upgrade = boost::beast::websocket::is_upgrade(request)};
}

}  // namespace torquer::viewer
