// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/distributed_rendering.h"

namespace raystage::farm {

/// Opens takes of which this host has only the documents (take.json, rig.json and timeline), to
/// plan a job whose archives are on its nodes. Frames come from the timeline, which is not checked.
/// Such takes cannot be rendered.
class DocumentOnlyTakes : public DistributedTakes {
 public:
  Take open(const std::filesystem::path& folder) override;
  void share(const Take& take, RendererSettings& settings) override;
};

}  // namespace raystage::farm
