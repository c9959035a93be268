// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

namespace raystage::sandbox {

/// Asks the parent to open a file for reading. Returns its descriptor, or -1 if there is none that
/// may be read. Safe in signal handlers.
int request_descriptor(std::string_view name);

/// The system calls that open files or look at them by name, for the filter to trap.
std::span<const int> brokered_calls();

/// Lets the parent answer trapped calls (SIGSYS), so that libraries which open files by name work
/// unchanged: what request_descriptor() opens exists, everything else does not. Returns false if
/// the handler cannot be installed.
bool install_call_broker();

}  // namespace raystage::sandbox
