// Exchange of an instrument for another device.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "host/api/impl.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"

namespace torquer {

namespace {

int NumberOf(const std::string& instrument, const Scene& scene) {
  std::vector<std::string> names;
  for (const InstrumentInfo& known : scene.instruments()) {
    if (known.name == instrument) return static_cast<int>(names.size());
    names.push_back(known.name);
  }
  const std::string near = NearestName(instrument, names);
  throw Error(fmt::format(
      "{} has no instrument {}; {}there are: {}", Printable(scene.name()), Printable(instrument),
      near.empty() ? "" : fmt::format("did you mean {}? ", near), fmt::join(names, ", ")));
}

}  // namespace

void Simulation::Impl::ContinueIn(const Scene& next, std::shared_ptr<scene::Scene> next_lent,
                                  std::unique_ptr<simulator::Simulation> next_simulation) {
  rows.ContinueIn(*next_simulation);
  // Each part refers to those after it.
  simulation = std::move(next_simulation);
  lent = std::move(next_lent);
  scene = next;
}

void Simulation::Exchange(const std::string& instrument, const std::string& device) {
  Impl& all = impl();
  const auto hold = all.usage.Change();
  const int k = NumberOf(instrument, all.scene);
  const Scene next = Guarded([&] {
    all.simulation->CheckExchange(k);
    // The scene at the start keeps the field, which both share.
    return Scene(std::make_shared<const Scene::Impl>(all.lent->WithDevice(k, device), false));
  });
  auto lent = next.impl_->Lend();
  auto built =
      Guarded([&] { return std::make_unique<simulator::Simulation>(*lent, *all.simulation, k); });
  all.ContinueIn(next, std::move(lent), std::move(built));
  all.past.AddExchange(k, device, next.content_hash());
}

}  // namespace torquer
