#include "firmware/src/usb_device.h"

#include <catch2/catch.hpp>
#include <iterator>

#include "firmware/src/usb_descriptors.h"
#include "tests/firmware/usb_conversation.h"

namespace torquer::firmware {
namespace {

TEST_CASE("descriptors come in packets of 32, cut to the requested length") {
  Conversation usb;
  CHECK(usb.Read(0x80, 6, 0x0100, 0, 18) ==
        std::vector<Bytes>{Bytes(std::begin(kDeviceDescriptor), std::end(kDeviceDescriptor))});
  CHECK(usb.Read(0x80, 6, 0x0100, 0, 8).at(0).size() == 8);
  const std::vector<Bytes> configuration = usb.Read(0x80, 6, 0x0200, 0, 255);
  REQUIRE(configuration.size() == 2);
  CHECK(configuration[0].size() == 32);
  CHECK(configuration[1].size() == 2);
  CHECK(configuration[0][2] == 34);
  CHECK(usb.Read(0x81, 6, 0x2200, 0, 255).size() == 3);
  CHECK(usb.Read(0x81, 6, 0x2100, 0, 255).at(0).size() == 9);
}

TEST_CASE("a transfer shorter than requested that ends on a full packet ends with an empty one") {
  Conversation usb;
  const std::vector<Bytes> longer = usb.Read(0xa1, 1, 0x0101, 0, 64);  // 32 bytes to send
  REQUIRE(longer.size() == 2);
  CHECK(longer[1].empty());
  CHECK(usb.Read(0xa1, 1, 0x0101, 0, 32).size() == 1);
}

TEST_CASE("strings are UTF-16 with their length") {
  Conversation usb;
  CHECK(usb.Read(0x80, 6, 0x0303, 0x409, 255) ==
        std::vector<Bytes>{{8, 3, 'A', 0, 'B', 0, '1', 0}});
  CHECK(usb.Read(0x80, 6, 0x0301, 0x409, 255).at(0) ==
        Bytes{16, 3, 'T', 0, 'o', 0, 'r', 0, 'q', 0, 'u', 0, 'e', 0, 'r', 0});
  CHECK(usb.Read(0x80, 6, 0x0300, 0, 255) == std::vector<Bytes>{{4, 3, 9, 4}});
}

TEST_CASE("an address holds from the end of the request on") {
  Conversation usb;
  board().can_send_control = false;  // the host has not fetched the status yet
  usb.Setup(0x00, 5, 17, 0, 0);
  CHECK(board().address == 0);
  board().can_send_control = true;
  usb.device.Poll();
  CHECK(board().address == 17);
}

TEST_CASE("configuring enables the input endpoint, a bus reset ends it") {
  Conversation usb;
  CHECK_FALSE(usb.device.configured());
  usb.Configure();
  CHECK(usb.device.configured());
  CHECK(board().input_enabled);
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  board().bus_reset = true;
  usb.device.Poll();
  CHECK_FALSE(usb.device.configured());
  usb.Configure();
  usb.Setup(0x00, 9, 0, 0, 0);
  CHECK_FALSE(usb.device.configured());
  CHECK_FALSE(board().input_enabled);
}

TEST_CASE("the input endpoint is halted, reported so, and freed") {
  Conversation usb;
  usb.Configure();
  usb.Setup(0x02, 3, 0, 0x81, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.Read(0x82, 0, 0, 0x81, 2) == std::vector<Bytes>{{1, 0}});
  usb.Setup(0x02, 1, 0, 0x81, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.Read(0x82, 0, 0, 0x81, 2) == std::vector<Bytes>{{0, 0}});
}

TEST_CASE("the host's leave to wake it is kept, reported, and ends with a bus reset") {
  Conversation usb;
  usb.Configure();
  CHECK(usb.Read(0x80, 0, 0, 0, 2) == std::vector<Bytes>{{0, 0}});
  usb.Setup(0x00, 3, 1, 0, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.device.may_wake_host());
  CHECK(usb.Read(0x80, 0, 0, 0, 2) == std::vector<Bytes>{{2, 0}});
  usb.Setup(0x00, 1, 1, 0, 0);
  CHECK_FALSE(usb.device.may_wake_host());
  usb.Setup(0x00, 3, 1, 0, 0);
  board().bus_reset = true;
  usb.device.Poll();
  CHECK_FALSE(usb.device.may_wake_host());
}

TEST_CASE("a refused request has no effect") {
  Conversation usb;
  usb.Configure();
  usb.Setup(0x00, 9, 0, 0, 1);
  CHECK(usb.device.configured());
  usb.Setup(0x02, 3, 0, 0x81, 1);
  CHECK_FALSE(board().input_halted);
  usb.Setup(0x00, 3, 1, 0, 1);
  CHECK_FALSE(usb.device.may_wake_host());
}

TEST_CASE("requests without sense are stalled") {
  Conversation usb;
  usb.Configure();
  struct Request {
    int type, request, value, index, length;
  };
  const Request requests[] = {
      {0x80, 6, 0x0600, 0, 10},                         // device qualifier of a full-speed device
      {0x80, 6, 0x0201, 0, 9},                          // second configuration
      {0x80, 6, 0x0304, 0x409, 9},                      // string without a text
      {0x00, 9, 2, 0, 0},                               // unknown configuration
      {0x00, 5, 128, 0, 0},                             // address out of range
      {0x00, 3, 2, 0, 0},                               // test mode of a full-speed device
      {0x00, 3, 1, 1, 0},                               // remote wake-up of another device
      {0x00, 3, 1, 0, 1},                               // remote wake-up with data
      {0x00, 9, 0, 0, 1},                               // configuration with data
      {0x00, 5, 9, 0, 1},                               // address with data
      {0x02, 3, 0, 0x81, 1},                            // halt with data
      {0x21, 10, 0x0700, 0, 1},                         // idle rate with data
      {0x02, 3, 0, 0x82, 0},                            // unknown endpoint
      {0x02, 3, 1, 0x81, 0},                            // unknown feature
      {0x01, 11, 1, 0, 0},                              // alternate interface
      {0xa1, 1, 0x0304, 0, 64},                         // feature report that cannot be read
      {0xa1, 1, 0x0203, 0, 64},                         // output report
      {0xa1, 1, 0x0303, 1, 64},                         // other interface
      {0x21, 9, 0x0303, 0, 0},                          // report without bytes
      {0x21, 9, 0x0303, 0, 4096},                       // report longer than any valid one
      {0x21, 9, 0x0203, 0, 16},                         // output report
      {0x21, 11, 0, 0, 0},                              // boot protocol
      {0xc0, 1, 0, 0, 1},                               // vendor request
      {0x40, 1, 0, 0, 0},          {0x80, 5, 0, 0, 0},  // SET_ADDRESS in the wrong direction
  };
  for (const Request& request : requests) {
    INFO("bmRequestType " << request.type << " bRequest " << request.request << " wValue "
                          << request.value);
    usb.Setup(request.type, request.request, request.value, request.index, request.length);
    CHECK(board().control_stalled);
    CHECK(board().control_sent.empty());
    // The next request is served.
    CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  }
}

TEST_CASE("without memory for the input endpoint the device is not configured") {
  Conversation usb;
  board().memory_refused = true;
  usb.Setup(0x00, 9, 1, 0, 0);
  CHECK(board().control_stalled);
  CHECK_FALSE(usb.device.configured());
  board().memory_refused = false;
  usb.Configure();
}

TEST_CASE("a new request ends the one under way, in every stage") {
  Conversation usb;
  usb.Configure();
  board().can_send_control = false;
  usb.Setup(0x80, 6, 0x0200, 0, 255);  // data to the host, not fetched
  board().can_send_control = true;
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  usb.Setup(0x21, 9, 0x0303, 0, 16);  // data from the host, never sent
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  usb.Setup(0x80, 6, 0x0200, 0, 255);  // status of a read, never sent
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
}

TEST_CASE("a host may end a read early") {
  Conversation usb;
  board().can_send_control = false;
  usb.Setup(0x80, 6, 0x0200, 0, 255);
  board().control_data.emplace_back();
  usb.device.Poll();
  board().can_send_control = true;
  for (int i = 0; i < 5; ++i) usb.device.Poll();
  CHECK(board().control_sent.empty());
}

}  // namespace
}  // namespace torquer::firmware
