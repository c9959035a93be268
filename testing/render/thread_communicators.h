// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <barrier>
#include <cstddef>
#include <utility>
#include <vector>

#include "render/common/rank_communicator.h"

namespace raystage::testing {

/// Hosts that are threads of this process; each has its own Group.
class ThreadCommunicators {
 public:
  explicit ThreadCommunicators(int hosts)
      : boxes_(static_cast<std::size_t>(hosts)), barrier_(hosts), hosts_(hosts) {}

  class Group : public render::RankCommunicator {
   public:
    Group(ThreadCommunicators& all, int host) : all_(all), host_(host) {}
    int rank() const override { return host_; }
    int size() const override { return all_.hosts_; }
    std::vector<Message> exchange(std::vector<Message> messages) const override {
      all_.boxes_[host_] = std::move(messages);
      all_.barrier_.arrive_and_wait();
      std::vector<Message> received;
      for (const auto& box : all_.boxes_) received.push_back(box[host_]);
      all_.barrier_.arrive_and_wait();
      return received;
    }

   private:
    ThreadCommunicators& all_;
    int host_;
  };

 private:
  std::vector<std::vector<render::RankCommunicator::Message>> boxes_;  // by sender and receiver
  std::barrier<> barrier_;
  int hosts_;
};

}  // namespace raystage::testing
