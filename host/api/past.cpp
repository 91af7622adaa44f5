#include "host/api/past.h"

#include <algorithm>
#include <cstring>

namespace torquer {

namespace {

constexpr std::size_t kBlockBytes = 4096;

constexpr char kStep = 'S';
constexpr char kRendering = 'P';
constexpr char kExchange = 'X';
// Bits of the flags of a step.
constexpr char kXray = 1;
constexpr char kContrast = 2;
constexpr char kNewControls = 4;

template <class Number>
void Put(std::string& bytes, Number value) {
  char raw[sizeof(Number)];
  std::memcpy(raw, &value, sizeof(Number));
  bytes.append(raw, sizeof(Number));
}

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  bool at_end() const { return bytes_.empty(); }
  template <class Number>
  Number Take() {
    if (bytes_.size() < sizeof(Number)) Refuse();
    Number value;
    std::copy_n(bytes_.begin(), sizeof(Number), reinterpret_cast<char*>(&value));
    bytes_.remove_prefix(sizeof(Number));
    return value;
  }
  std::string TakeText() {
    const auto bytes = Take<std::uint32_t>();
    if (bytes_.size() < bytes) Refuse();
    std::string text(bytes_.substr(0, bytes));
    bytes_.remove_prefix(bytes);
    return text;
  }
  [[noreturn]] static void Refuse() {
    throw Error("the saved simulation is damaged; save it again");
  }

 private:
  std::string_view bytes_;
};

using Rendering = std::pair<std::uint32_t, int>;

// The numbers of a command that rarely change from step to step.
std::vector<double> ControlsOf(const Command& row) {
  const Imaging& imaging = row.imaging;
  return {row.lao_deg,
          row.cra_deg,
          static_cast<double>(imaging.mode),
          imaging.pulses_per_s,
          imaging.magnification,
          imaging.left,
          imaging.right,
          imaging.top,
          imaging.bottom,
          imaging.wedge_left.share,
          imaging.wedge_left.rotation_deg,
          imaging.wedge_right.share,
          imaging.wedge_right.rotation_deg,
          row.table.left_mm,
          row.table.head_mm,
          row.table.height_mm,
          static_cast<double>(row.injector.order),
          row.injector.volume_mL,
          row.injector.rate_mL_s,
          row.injector.delay_s,
          row.injector.rise_s};
}

void TakeControls(Reader& reader, Command& row) {
  row.lao_deg = reader.Take<double>();
  row.cra_deg = reader.Take<double>();
  Imaging& imaging = row.imaging;
  const auto mode = reader.Take<double>();
  if (!(mode >= 0 && mode <= static_cast<double>(Imaging::Mode::kCine))) Reader::Refuse();
  imaging.mode = static_cast<Imaging::Mode>(static_cast<int>(mode));
  for (double* const value :
       {&imaging.pulses_per_s, &imaging.magnification, &imaging.left, &imaging.right, &imaging.top,
        &imaging.bottom, &imaging.wedge_left.share, &imaging.wedge_left.rotation_deg,
        &imaging.wedge_right.share, &imaging.wedge_right.rotation_deg, &row.table.left_mm,
        &row.table.head_mm, &row.table.height_mm}) {
    *value = reader.Take<double>();
  }
  Injector& injector = row.injector;
  const auto order = reader.Take<double>();
  if (!(order >= 0 && order <= static_cast<double>(Injector::Order::kInject))) Reader::Refuse();
  injector.order = static_cast<Injector::Order>(static_cast<int>(order));
  for (double* const value :
       {&injector.volume_mL, &injector.rate_mL_s, &injector.delay_s, &injector.rise_s}) {
    *value = reader.Take<double>();
  }
}

// Reads the rest of a step into `row`, which is the row before.
void RepeatStep(Reader& reader, std::size_t hands, const Past::Actions& actions, Command& row) {
  const auto flags = reader.Take<char>();
  row.xray = (flags & kXray) != 0;
  row.contrast = (flags & kContrast) != 0;
  row.time_s = reader.Take<double>();
  row.hands.resize(hands);
  for (Hand& hand : row.hands) {
    hand.insertion_mm = reader.Take<double>();
    hand.rotation_rad = reader.Take<double>();
  }
  if ((flags & kNewControls) != 0) TakeControls(reader, row);
  const auto ticks = reader.Take<std::uint32_t>();
  std::vector<Rendering> renderings;
  for (auto left = reader.Take<std::uint32_t>(); left > 0; --left) {
    const auto tick = reader.Take<std::uint32_t>();
    renderings.emplace_back(tick, reader.Take<std::uint8_t>());
  }
  const std::uint32_t done = actions.step(row, [&](std::uint32_t tick) {
    for (const auto& [at, plane] : renderings) {
      if (at == tick) actions.render(plane);
    }
    return tick < ticks;
  });
  if (done != ticks) Reader::Refuse();
}

}  // namespace

Past::Block::~Block() {
  // One by one, because the destructors of a long chain within each other overflow the stack.
  thread_local std::vector<std::shared_ptr<const Block>>* waiting = nullptr;
  if (before == nullptr) return;
  if (waiting != nullptr) {
    waiting->push_back(std::move(before));
    return;
  }
  std::vector<std::shared_ptr<const Block>> chain;
  chain.push_back(std::move(before));
  waiting = &chain;
  while (!chain.empty()) {
    const std::shared_ptr<const Block> next = std::move(chain.back());
    chain.pop_back();
  }
  waiting = nullptr;
}

Past::Past(const Past& other) : blocks_(other.blocks_), newest_(other.newest_), last_(other.last_) {
  if (other.open_ != nullptr) Write(*other.open_);
}

Past& Past::operator=(const Past& other) {
  if (this != &other) *this = Past(other);
  return *this;
}

void Past::BeginStep(const Command& row) {
  open_ = std::make_unique<OpenStep>();
  open_->row = row;
}

void Past::AddTick() { ++open_->ticks; }

void Past::EndStep() {
  const std::unique_ptr<OpenStep> step = std::move(open_);
  if (step->ticks > 0) Write(*step);
}

void Past::AddRendering(int plane) {
  if (open_ != nullptr) {
    open_->renderings.emplace_back(open_->ticks, plane);
    return;
  }
  newest_ += kRendering;
  Put(newest_, static_cast<std::uint8_t>(plane));
}

void Past::AddExchange(int instrument, const std::string& device, std::uint64_t scene_hash) {
  newest_ += kExchange;
  Put(newest_, static_cast<std::uint8_t>(instrument));
  Put(newest_, scene_hash);
  Put(newest_, static_cast<std::uint32_t>(device.size()));
  newest_ += device;
}

void Past::Write(const OpenStep& step) {
  if (newest_.size() >= kBlockBytes) {
    blocks_ = std::make_shared<const Block>(blocks_, std::move(newest_));
    newest_.clear();
  }
  const Command& row = step.row;
  const std::vector<double> controls = ControlsOf(row);
  const bool is_new = controls != ControlsOf(last_);
  newest_ += kStep;
  newest_ += static_cast<char>((row.xray ? kXray : 0) | (row.contrast ? kContrast : 0) |
                               (is_new ? kNewControls : 0));
  Put(newest_, row.time_s);
  for (const Hand& hand : row.hands) {
    Put(newest_, hand.insertion_mm);
    Put(newest_, hand.rotation_rad);
  }
  if (is_new) {
    for (const double value : controls) Put(newest_, value);
  }
  Put(newest_, step.ticks);
  Put(newest_, static_cast<std::uint32_t>(step.renderings.size()));
  for (const auto& [tick, plane] : step.renderings) {
    Put(newest_, tick);
    Put(newest_, static_cast<std::uint8_t>(plane));
  }
  last_ = row;
}

std::string Past::Bytes() const {
  if (open_ != nullptr) return Past(*this).Bytes();
  std::vector<const std::string*> parts = {&newest_};
  for (const Block* block = blocks_.get(); block != nullptr; block = block->before.get()) {
    parts.push_back(&block->bytes);
  }
  std::string bytes;
  std::for_each(parts.rbegin(), parts.rend(), [&](const std::string* part) { bytes += *part; });
  return bytes;
}

void Past::Repeat(std::string_view bytes, std::size_t hands, const Actions& actions) {
  Reader reader(bytes);
  Command row;
  while (!reader.at_end()) {
    const auto kind = reader.Take<char>();
    if (kind == kRendering) {
      actions.render(reader.Take<std::uint8_t>());
    } else if (kind == kExchange) {
      const auto instrument = reader.Take<std::uint8_t>();
      if (instrument >= hands) Reader::Refuse();
      const auto scene_hash = reader.Take<std::uint64_t>();
      actions.exchange(instrument, reader.TakeText(), scene_hash);
    } else if (kind == kStep) {
      RepeatStep(reader, hands, actions, row);
    } else {
      Reader::Refuse();
    }
  }
}

}  // namespace torquer
