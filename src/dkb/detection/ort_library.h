// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace dkb {

// ONNX Runtime's objects, seen from outside: never looked into, given back by the release function of their kind.
struct OrtStatus;  // of a call; null = it went well
struct OrtEnvironment;
struct OrtOptions;  // of a session
struct OrtSession;  // a graph, ready to run
struct OrtMemory;   // where a tensor's numbers lie
struct OrtAllocator;
struct OrtValue;  // a tensor
struct OrtShape;  // its type and dimensions
struct OrtRunOptions;

// ONNX Runtime's shared library and what is used of its C interface. The interface is a table of functions to which
// versions only append, so a function's place in the table is what makes it callable.
struct OrtTable {
  using Function = void (*)();
  struct Place {
    Function function;
    template <class F>
    operator F*() const {
      return reinterpret_cast<F*>(function);
    }
  };

  const Function* functions;
  Place operator()(size_t place) const { return {functions[place]}; }
};

// The places are those of ONNX Runtime's reference of its C interface. Enumerations travel as int.
struct OrtLibrary {
  std::string name;  // file and version: for messages
  OrtTable at;

  const char* (*error_message)(const OrtStatus*) = at(2);
  void (*release_status)(OrtStatus*) = at(93);

  // log level (4 = fatal errors only), the log's name
  OrtStatus* (*create_environment)(int, const char*, OrtEnvironment**) = at(3);
  void (*release_environment)(OrtEnvironment*) = at(92);

  OrtStatus* (*create_options)(OrtOptions**) = at(10);
  OrtStatus* (*disable_memory_pattern)(OrtOptions*) = at(17);
  OrtStatus* (*set_optimisation)(OrtOptions*, int) = at(23);  // 99 = all
  OrtStatus* (*set_threads_within)(OrtOptions*, int) = at(24);
  OrtStatus* (*set_threads_between)(OrtOptions*, int) = at(25);
  OrtStatus* (*set_entry)(OrtOptions*, const char*, const char*) = at(130);  // key, value
  void (*release_options)(OrtOptions*) = at(100);

  // of the graph's bytes and their number
  OrtStatus* (*create_session)(const OrtEnvironment*, const void*, size_t, const OrtOptions*, OrtSession**) = at(8);
  OrtStatus* (*output_count)(const OrtSession*, size_t*) = at(31);
  OrtStatus* (*output_name)(const OrtSession*, size_t, OrtAllocator*, char**) = at(37);  // freed by `free`
  // names and values of the inputs, their number; the same of the outputs, whose values are null before
  OrtStatus* (*run)(OrtSession*, const OrtRunOptions*, const char* const*, const OrtValue* const*, size_t,
                    const char* const*, size_t, OrtValue**) = at(9);
  void (*release_session)(OrtSession*) = at(95);

  OrtStatus* (*default_allocator)(OrtAllocator**) = at(78);  // not to be released
  OrtStatus* (*free)(OrtAllocator*, void*) = at(76);
  // kind of allocator (0 = none of its own), of memory (0)
  OrtStatus* (*create_cpu_memory)(int, int, OrtMemory**) = at(69);
  void (*release_memory)(OrtMemory*) = at(94);

  // a tensor over the caller's numbers: their bytes, dimensions and their number, type (1 = float)
  OrtStatus* (*create_tensor)(const OrtMemory*, void*, size_t, const int64_t*, size_t, int, OrtValue**) = at(49);
  OrtStatus* (*is_tensor)(const OrtValue*, int*) = at(50);
  OrtStatus* (*tensor_data)(OrtValue*, void**) = at(51);
  OrtStatus* (*shape_of)(const OrtValue*, OrtShape**) = at(65);
  OrtStatus* (*element_type)(const OrtShape*, int*) = at(60);
  OrtStatus* (*rank)(const OrtShape*, size_t*) = at(61);
  OrtStatus* (*dimensions)(const OrtShape*, int64_t*, size_t) = at(62);
  void (*release_shape)(OrtShape*) = at(99);
  void (*release_value)(OrtValue*) = at(96);
};

// Loads the library: what $DKB_ONNXRUNTIME names (a file, or the folder that holds libonnxruntime.so.1), else the file
// beside the program, in the installation's folder of libraries, where `make onnxruntime` puts it, or where the system
// finds it. Nothing when there is none or it is not of a known version; `reason` says why in one line. It is never
// closed.
std::optional<OrtLibrary> load_onnxruntime(std::string* reason);

// Whether $DKB_ONNXRUNTIME names one.
bool onnxruntime_is_named();

}  // namespace dkb
