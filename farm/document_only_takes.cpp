// SPDX-License-Identifier: Apache-2.0
#include "farm/document_only_takes.h"

#include <stdexcept>

namespace raystage::farm {
namespace {

class UnknownArchives : public RemoteArchives {
 public:
  std::optional<ArchiveReader> open(int /*camera*/) const override {
    return ArchiveReader({}, {}, nullptr);
  }
  bool is_missing(int /*camera*/) const override { return false; }
  bool are_unknown() const override { return true; }
};

}  // namespace

Take DocumentOnlyTakes::open(const std::filesystem::path& folder) {
  return Take(folder, std::make_shared<const UnknownArchives>());
}

void DocumentOnlyTakes::share(const Take& /*take*/, RendererSettings& /*settings*/) {
  throw std::logic_error("a take without archives cannot be rendered");
}

}  // namespace raystage::farm
