// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/distributed_rendering.h"

namespace raystage::farm {

/// Opens takes whose archives are on the nodes of a job, to plan the job on a host that has only
/// their documents: take.json, rig.json and timeline. Frames are known by the timeline, which is
/// not checked. Nothing can be rendered.
class DocumentOnlyTakes : public DistributedTakes {
 public:
  Take open(const std::filesystem::path& folder) override;
  void share(const Take& take, RendererSettings& settings) override;
};

}  // namespace raystage::farm
