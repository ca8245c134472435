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
// versions only append, so a function's place in the table, written down in ort_library.cpp, is what makes it callable.
// Enumerations travel as int.
struct OrtLibrary {
  std::string name;  // file and version: for messages

  const char* (*error_message)(const OrtStatus*);
  void (*release_status)(OrtStatus*);

  // log level (4 = fatal errors only), the log's name
  OrtStatus* (*create_environment)(int, const char*, OrtEnvironment**);
  void (*release_environment)(OrtEnvironment*);

  OrtStatus* (*create_options)(OrtOptions**);
  OrtStatus* (*disable_memory_pattern)(OrtOptions*);
  OrtStatus* (*set_optimisation)(OrtOptions*, int);  // 99 = all
  OrtStatus* (*set_threads_within)(OrtOptions*, int);
  OrtStatus* (*set_threads_between)(OrtOptions*, int);
  OrtStatus* (*set_entry)(OrtOptions*, const char*, const char*);  // key, value
  void (*release_options)(OrtOptions*);

  OrtStatus* (*create_session)(const OrtEnvironment*, const void*, size_t, const OrtOptions*, OrtSession**);  // bytes
  OrtStatus* (*output_count)(const OrtSession*, size_t*);
  OrtStatus* (*output_name)(const OrtSession*, size_t, OrtAllocator*, char**);  // freed by `free`
  // names and values of the inputs, their number; the same of the outputs, whose values are null before
  OrtStatus* (*run)(OrtSession*, const OrtRunOptions*, const char* const*, const OrtValue* const*, size_t,
                    const char* const*, size_t, OrtValue**);
  void (*release_session)(OrtSession*);

  OrtStatus* (*default_allocator)(OrtAllocator**);  // not to be released
  OrtStatus* (*free)(OrtAllocator*, void*);
  OrtStatus* (*create_cpu_memory)(int, int, OrtMemory**);  // kind of allocator (0 = none of its own), of memory (0)
  void (*release_memory)(OrtMemory*);

  // a tensor over the caller's numbers: their bytes, dimensions and their number, type (1 = float)
  OrtStatus* (*create_tensor)(const OrtMemory*, void*, size_t, const int64_t*, size_t, int, OrtValue**);
  OrtStatus* (*is_tensor)(const OrtValue*, int*);
  OrtStatus* (*tensor_data)(OrtValue*, void**);
  OrtStatus* (*shape_of)(const OrtValue*, OrtShape**);
  OrtStatus* (*element_type)(const OrtShape*, int*);
  OrtStatus* (*rank)(const OrtShape*, size_t*);
  OrtStatus* (*dimensions)(const OrtShape*, int64_t*, size_t);
  void (*release_shape)(OrtShape*);
  void (*release_value)(OrtValue*);
};

// Loads the library: what $DKB_ONNXRUNTIME names (a file, or the folder that holds libonnxruntime.so.1), else the file
// beside the program, in the installation's folder of libraries, where `make onnxruntime` puts it, or where the system
// finds it. Nothing when there is none or it is not of a known version; `reason` says why in one line. It is never
// closed.
std::optional<OrtLibrary> load_onnxruntime(std::string* reason);

// Whether $DKB_ONNXRUNTIME names one.
bool onnxruntime_is_named();

}  // namespace dkb
