// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/libcurl.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {
namespace {

constexpr const char* kLibcurl = "libcurl.so.4";  // the only ABI since 2006

ConfigurationError no_libcurl(const std::string& why) {
  return ConfigurationError(Error::failed(fmt::format("libcurl cannot be used: {}", why), kLibcurl,
                                          "Install the package libcurl4"));
}

template <typename Function>
void find_function(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(library, name));
  if (function == nullptr) throw no_libcurl(fmt::format("it has no function {}", name));
}

Libcurl load_libcurl() {
  void* library = dlopen(kLibcurl, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) throw no_libcurl("it cannot be loaded");
  Libcurl table;
  find_function(library, "curl_global_init", table.global_init);
  find_function(library, "curl_easy_init", table.easy_init);
  find_function(library, "curl_easy_cleanup", table.easy_cleanup);
  find_function(library, "curl_easy_reset", table.easy_reset);
  find_function(library, "curl_easy_setopt", table.easy_setopt);
  find_function(library, "curl_easy_getinfo", table.easy_getinfo);
  find_function(library, "curl_easy_pause", table.easy_pause);
  find_function(library, "curl_easy_header", table.easy_header);
  find_function(library, "curl_easy_strerror", table.easy_strerror);
  find_function(library, "curl_multi_init", table.multi_init);
  find_function(library, "curl_multi_cleanup", table.multi_cleanup);
  find_function(library, "curl_multi_add_handle", table.multi_add_handle);
  find_function(library, "curl_multi_remove_handle", table.multi_remove_handle);
  find_function(library, "curl_multi_perform", table.multi_perform);
  find_function(library, "curl_multi_info_read", table.multi_info_read);
  find_function(library, "curl_multi_poll", table.multi_poll);
  find_function(library, "curl_slist_append", table.slist_append);
  find_function(library, "curl_slist_free_all", table.slist_free_all);
  find_function(library, "curl_url", table.url);
  find_function(library, "curl_url_cleanup", table.url_cleanup);
  find_function(library, "curl_url_dup", table.url_dup);
  find_function(library, "curl_url_set", table.url_set);
  find_function(library, "curl_url_get", table.url_get);
  find_function(library, "curl_url_strerror", table.url_strerror);
  find_function(library, "curl_free", table.free);
  const CURLcode code = table.global_init(CURL_GLOBAL_DEFAULT);
  if (code != CURLE_OK) throw no_libcurl(table.easy_strerror(code));
  return table;
}

}  // namespace

const Libcurl& libcurl() {
  static const Libcurl loaded = load_libcurl();
  return loaded;
}

}  // namespace raystage::ingest
