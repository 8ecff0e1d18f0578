/* sphm_device_ops with CUDA's runtime: memory, copies, two streams, one graph. */
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "cuda/runtime.h"

#include "core/backend.h"
#include "cuda/check.h"
#include "cuda/device.h"
#include "cuda/fluid_backend.h"
#include "cuda/fluid_launch.h"
#include "cuda/look_launch.h"
#include "cuda/solid_backend.h"
#include "cuda/solid_launch.h"
#include "cuda/sort.h"

enum { MOST_ALLOCATIONS = 4 };
static_assert((int)SPHM_SOLID_LAUNCHES <= (int)SPHM_LAUNCH_KINDS &&
                  (int)SPHM_FLUID_LAUNCHES <= (int)SPHM_LAUNCH_KINDS,
              "times of all launches");

struct sphm_device {
    int index;
    char name[128];
    cudaStream_t stream;       /* of the steps */
    cudaStream_t looking;      /* beside it */
    cudaEvent_t there, marked; /* what is looked at is there; the look is finished */
    cudaGraphExec_t graph;     /* what was kept; null: nothing */
    cudaEvent_t begin, end;    /* null: launches are not timed */
    double launch_s[SPHM_LAUNCH_KINDS];
    int together; /* steps of the solid */
    int memory_count, host_memory_count;
    void *memory[MOST_ALLOCATIONS], *host_memory[MOST_ALLOCATIONS];
};

namespace {

#define TRY(call, what)                                                                                      \
    do {                                                                                                     \
        const sphm_status tried = sphm_cuda_check(call, what, context);                                      \
        if (tried != SPHM_OK)                                                                                \
            return tried;                                                                                    \
    } while (0)

/* Threads have their own idea of which device is meant: the node creates and steps in different ones. */
sphm_status use(const sphm_device *device, sphm_context *context) {
    return sphm_cuda_check(cudaSetDevice(device->index), "use the device", context);
}

void close(sphm_device *device) {
    if (!device)
        return;
    /* What fails here has been reported already, and nothing can be done about it. */
    (void)cudaSetDevice(device->index);
    for (cudaStream_t stream : {device->stream, device->looking})
        if (stream)
            (void)cudaStreamSynchronize(stream);
    if (device->graph)
        (void)cudaGraphExecDestroy(device->graph);
    for (int k = 0; k < device->memory_count; ++k)
        (void)cudaFree(device->memory[k]);
    for (int k = 0; k < device->host_memory_count; ++k)
        (void)cudaFreeHost(device->host_memory[k]);
    for (cudaEvent_t event : {device->begin, device->end, device->there, device->marked})
        if (event)
            (void)cudaEventDestroy(event);
    for (cudaStream_t stream : {device->stream, device->looking})
        if (stream)
            (void)cudaStreamDestroy(stream);
    (void)cudaGetLastError();
    free(device);
}

sphm_status prepare(sphm_device *device, sphm_context *context) {
    cudaDeviceProp properties;
    TRY(cudaGetDevice(&device->index), "say which device is current"); /* CUDA_VISIBLE_DEVICES chooses */
    TRY(cudaGetDeviceProperties(&properties, device->index), "describe the device");
    snprintf(device->name, sizeof device->name, "cuda: %.96s (sm_%d%d)", properties.name, properties.major,
             properties.minor);
    TRY(cudaSetDevice(device->index), "use the device");
    /* Non-blocking: they do not wait for the default stream, which other code in the process may use. Where
     * both have blocks to start, the steps' come first. */
    int least = 0, greatest = 0;
    TRY(cudaDeviceGetStreamPriorityRange(&least, &greatest), "say which priorities streams have");
    TRY(cudaStreamCreateWithPriority(&device->stream, cudaStreamNonBlocking, greatest), "make a stream");
    TRY(cudaStreamCreateWithPriority(&device->looking, cudaStreamNonBlocking, least), "make a stream");
    TRY(cudaEventCreateWithFlags(&device->there, cudaEventDisableTiming), "make an event");
    TRY(cudaEventCreateWithFlags(&device->marked, cudaEventDisableTiming), "make an event");
    for (const auto load : {sphm_cuda_load_solid, sphm_cuda_load_fluid, sphm_cuda_load_look}) {
        const sphm_status loaded = load(context);
        if (loaded != SPHM_OK)
            return loaded;
    }
    device->together = getenv("SPH_MUSCLE_PERSISTENT") != NULL; /* until it is known which is faster */
    if (getenv("SPH_MUSCLE_TIME_LAUNCHES")) { /* bench/gpu.sh; a parameter would be in every muscle's file */
        TRY(cudaEventCreate(&device->begin), "make an event");
        TRY(cudaEventCreate(&device->end), "make an event");
    }
    return SPHM_OK;
}

sphm_status open(sphm_device **opened, sphm_context *context) {
    *opened = NULL;
    sphm_device *device = (sphm_device *)calloc(1, sizeof *device);
    if (!device)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "no memory for a CUDA device");
    const sphm_status status = prepare(device, context);
    if (status != SPHM_OK) {
        close(device);
        return status;
    }
    *opened = device;
    return SPHM_OK;
}

const char *name(const sphm_device *device) {
    return device->name;
}

sphm_status allocate(sphm_device *device, size_t bytes, void **memory, sphm_context *context) {
    size_t available = 0, total = 0;
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    if (device->memory_count == MOST_ALLOCATIONS)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "more than %d allocations", (int)MOST_ALLOCATIONS);
    TRY(cudaMemGetInfo(&available, &total), "say how much memory is free");
    const cudaError_t error = cudaMalloc(memory, bytes);
    if (error == cudaErrorMemoryAllocation) {
        (void)cudaGetLastError();
        return sphm_fail(context, SPHM_REFUSED_MEMORY,
                         "%s has %zu MiB of %zu MiB free, and %zu MiB are needed", device->name,
                         available >> 20, total >> 20, (bytes >> 20) + 1);
    }
    TRY(error, "allocate memory");
    device->memory[device->memory_count++] = *memory;
    TRY(cudaMemsetAsync(*memory, 0, bytes, device->stream), "clear memory");
    return SPHM_OK;
}

sphm_status allocate_host(sphm_device *device, size_t bytes, void **memory, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    if (device->host_memory_count == MOST_ALLOCATIONS)
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "more than %d allocations", (int)MOST_ALLOCATIONS);
    TRY(cudaHostAlloc(memory, bytes, cudaHostAllocDefault), "allocate page-locked memory");
    device->host_memory[device->host_memory_count++] = *memory;
    memset(*memory, 0, bytes);
    return SPHM_OK;
}

sphm_status copy(sphm_device *device, void *to, const void *from, size_t bytes, cudaMemcpyKind kind,
                 sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK || bytes == 0)
        return status;
    return sphm_cuda_check(cudaMemcpyAsync(to, from, bytes, kind, device->stream), "copy", context);
}

sphm_status upload(sphm_device *device, void *to, const void *from, size_t bytes, sphm_context *context) {
    return copy(device, to, from, bytes, cudaMemcpyHostToDevice, context);
}

sphm_status download(sphm_device *device, void *to, const void *from, size_t bytes, sphm_context *context) {
    return copy(device, to, from, bytes, cudaMemcpyDeviceToHost, context);
}

/* Nobody can be told what fails here; the next call will say it. */
void release(sphm_device *device, void *memory) {
    for (int k = 0; k < device->memory_count; ++k)
        if (device->memory[k] == memory) {
            (void)cudaSetDevice(device->index);
            (void)cudaStreamSynchronize(device->stream);
            (void)cudaFree(memory);
            device->memory[k] = device->memory[--device->memory_count];
            return;
        }
}

/* Waits for it: what is measured is this launch alone, with the device idle before and after. */
template <class Launch>
sphm_status launch_timed(sphm_device *device, int which, Launch launch, sphm_context *context) {
    float elapsed_ms = 0;
    TRY(cudaEventRecord(device->begin, device->stream), "record an event");
    const sphm_status status = launch();
    if (status != SPHM_OK)
        return status;
    TRY(cudaEventRecord(device->end, device->stream), "record an event");
    TRY(cudaStreamSynchronize(device->stream), "finish a launch");
    TRY(cudaEventElapsedTime(&elapsed_ms, device->begin, device->end), "time a launch");
    device->launch_s[which] += 1e-3 * (double)elapsed_ms;
    return SPHM_OK;
}

template <class Launch>
sphm_status launch_any(sphm_device *device, int which, Launch launch, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    return device->end ? launch_timed(device, which, launch, context) : launch();
}

sphm_status launch(sphm_device *device, const sphm_solid_device *solid, const sphm_solid_call *call,
                   sphm_context *context) {
    return launch_any(
        device, call->launch, [&] { return sphm_cuda_launch_solid(device->stream, solid, call, context); },
        context);
}

sphm_status launch_fluid(sphm_device *device, const sphm_fluid_device *fluid, const sphm_fluid_call *call,
                         sphm_context *context) {
    return launch_any(
        device, call->launch, [&] { return sphm_cuda_launch_fluid(device->stream, fluid, call, context); },
        context);
}

sphm_status fluid_scratch(sphm_device *device, const sphm_fluid_device *fluid, size_t *bytes,
                          sphm_context *context) {
    const sphm_status status = use(device, context);
    return status == SPHM_OK ? sphm_cuda_scratch(fluid, bytes, context) : status;
}

const double *launch_times(const sphm_device *device) {
    return device->end ? device->launch_s : NULL;
}

/* Thread-local: other threads' muscles may allocate meanwhile. */
sphm_status record(sphm_device *device, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    return sphm_cuda_check(cudaStreamBeginCapture(device->stream, cudaStreamCaptureModeThreadLocal),
                           "record launches", context);
}

sphm_status keep(sphm_device *device, sphm_context *context) {
    cudaGraph_t graph = NULL;
    TRY(cudaStreamEndCapture(device->stream, &graph), "keep the recorded launches");
    if (device->graph)
        (void)cudaGraphExecDestroy(device->graph);
    device->graph = NULL;
    /* cudaGraphInstantiate() has other arguments in CUDA 11 than from 12 on; this one does not change. */
    const cudaError_t error = cudaGraphInstantiateWithFlags(&device->graph, graph, 0);
    (void)cudaGraphDestroy(graph);
    return sphm_cuda_check(error, "make a graph of the launches", context);
}

sphm_status play(sphm_device *device, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    return sphm_cuda_check(cudaGraphLaunch(device->graph, device->stream), "launch the graph", context);
}

sphm_status wait(sphm_device *device, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    return sphm_cuda_check(cudaStreamSynchronize(device->stream), "finish what it was given", context);
}

/* Looking ------------------------------------------------------------------------------------------------ */

sphm_status look_after(sphm_device *device, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    TRY(cudaEventRecord(device->there, device->stream), "record an event");
    return sphm_cuda_check(cudaStreamWaitEvent(device->looking, device->there, 0), "wait for an event",
                           context);
}

sphm_status launch_look(sphm_device *device, const sphm_look_device *look, int launch,
                        sphm_context *context) {
    const sphm_status status = use(device, context);
    return status == SPHM_OK ? sphm_cuda_launch_look(device->looking, look, launch, context) : status;
}

sphm_status bring(sphm_device *device, void *to, const void *from, size_t bytes, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK || bytes == 0)
        return status;
    return sphm_cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, device->looking), "copy",
                           context);
}

sphm_status mark(sphm_device *device, sphm_context *context) {
    const sphm_status status = use(device, context);
    if (status != SPHM_OK)
        return status;
    return sphm_cuda_check(cudaEventRecord(device->marked, device->looking), "record an event", context);
}

sphm_status marked(sphm_device *device, int wait, int *done, sphm_context *context) {
    const sphm_status status = use(device, context);
    *done = 0;
    if (status != SPHM_OK)
        return status;
    const cudaError_t error = wait ? cudaEventSynchronize(device->marked) : cudaEventQuery(device->marked);
    if (error == cudaErrorNotReady) {
        (void)cudaGetLastError();
        return SPHM_OK;
    }
    TRY(error, "finish a look");
    *done = 1;
    return SPHM_OK;
}

int together(const sphm_device *device) {
    return device->together;
}

const sphm_device_ops device_ops = {open,   close,    name,         allocate,     allocate_host, release,
                                    upload, download, launch,       launch_fluid, fluid_scratch, record,
                                    keep,   play,     launch_times, wait,         look_after,    launch_look,
                                    bring,  mark,     marked,       together};

sphm_status create_solid(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    return sphm_device_solid_create(&device_ops, model, backend, context);
}

sphm_status create_fluid(const sphm_model *model, sphm_backend **backend, sphm_context *context) {
    return sphm_device_fluid_create(&device_ops, model, backend, context);
}

sphm_backend_ops make_fluid_backend() {
    sphm_backend_ops ops = sphm_device_fluid_backend;
    ops.create = create_fluid;
    return ops;
}

sphm_backend_ops make_solid_backend() {
    sphm_backend_ops ops = sphm_device_solid_backend;
    ops.create = create_solid;
    return ops;
}

} // namespace

extern "C" const sphm_backend_ops *sphm_cuda_solid_backend(void) {
    static const sphm_backend_ops ops = make_solid_backend();
    return &ops;
}

extern "C" const sphm_backend_ops *sphm_cuda_fluid_backend(void) {
    static const sphm_backend_ops ops = make_fluid_backend();
    return &ops;
}
