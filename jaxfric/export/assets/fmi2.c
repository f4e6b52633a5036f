/* @name@: the force of an axis, identified by jaxfric, behind the functions of FMI 2.0.
 *
 * C99 and a header of FMI 2.0, which the importing tool brings. The model has no state: outputs
 * follow from inputs, parameters and time at once. Units: @force@, @position@, s.
@lacks@ */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define COUNT @count@ /* values: inputs, outputs, parameters */

static const double start[COUNT] = {@start@};

typedef struct {
    double values[COUNT];
    double time;
} instance;

@helper@
/* Outputs from inputs, parameters and time. */
static void evaluate(double *real, double time)
{
    const double x = real[0], v = real[1], a = real[2], t = time;
@parameters@    double u = 0.0;

@friction@    real[3] = u;
@rest@    real[4] = u;
    (void)x, (void)v, (void)a, (void)t;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)c, (void)on, (void)n, (void)names;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging)
{
    instance *made;

    (void)name, (void)type, (void)resources, (void)functions, (void)visible, (void)logging;
    if (guid == NULL || strcmp(guid, "@guid@") != 0) return NULL;
    made = calloc(1, sizeof *made);
    if (made != NULL) memcpy(made->values, start, sizeof start);
    return made;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean with_tolerance, fmi2Real tolerance,
                               fmi2Real begin, fmi2Boolean with_end, fmi2Real end)
{
    (void)with_tolerance, (void)tolerance, (void)with_end, (void)end;
    ((instance *)c)->time = begin;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c)
{
    memcpy(((instance *)c)->values, start, sizeof start);
    ((instance *)c)->time = 0.0;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    instance *own = c;

    evaluate(own->values, own->time);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT) return fmi2Error;
        value[i] = own->values[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real value[])
{
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT) return fmi2Error;
        ((instance *)c)->values[vr[i]] = value[i];
    }
    return fmi2OK;
}

/* There are no values of other types: an empty list is fine. */
#define NONE(name, type)                                                                          \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[])       \
    {                                                                                             \
        (void)c, (void)vr, (void)value;                                                           \
        return n ? fmi2Error : fmi2OK;                                                            \
    }
NONE(fmi2GetInteger, fmi2Integer)
NONE(fmi2GetBoolean, fmi2Boolean)
NONE(fmi2GetString, fmi2String)
NONE(fmi2SetInteger, const fmi2Integer)
NONE(fmi2SetBoolean, const fmi2Boolean)
NONE(fmi2SetString, const fmi2String)

/* Model exchange: no continuous states, no events. */
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    ((instance *)c)->time = time;
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    (void)c;
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean kept, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    (void)c, (void)kept;
    *event = *terminate = fmi2False;
    return fmi2OK;
}

#define EMPTY(name, pointer)                                                                      \
    fmi2Status name(fmi2Component c, pointer values, size_t n)                                    \
    {                                                                                             \
        (void)c, (void)values;                                                                    \
        return n ? fmi2Error : fmi2OK;                                                            \
    }
EMPTY(fmi2SetContinuousStates, const fmi2Real *)
EMPTY(fmi2GetContinuousStates, fmi2Real *)
EMPTY(fmi2GetDerivatives, fmi2Real *)
EMPTY(fmi2GetEventIndicators, fmi2Real *)
EMPTY(fmi2GetNominalsOfContinuousStates, fmi2Real *)

/* Co-simulation: a step moves the time. */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real step, fmi2Boolean kept)
{
    (void)kept;
    return fmi2SetTime(c, from + step);
}

fmi2Status fmi2CancelStep(fmi2Component c) { (void)c; return fmi2Error; }

/* A state is a copy of the values. */
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) *state = malloc(sizeof(instance));
    if (*state == NULL) return fmi2Error;
    memcpy(*state, c, sizeof(instance));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(c, state, sizeof(instance));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

/* What modelDescription.xml does not promise is refused. */
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state, (void)size;
    return fmi2Error;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t n)
{
    (void)c, (void)state, (void)bytes, (void)n;
    return fmi2Error;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t n,
                                   fmi2FMUstate *state)
{
    (void)c, (void)bytes, (void)n, (void)state;
    return fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t n, const fmi2ValueReference known[], size_t m,
                                        const fmi2Real given[], fmi2Real found[])
{
    (void)c, (void)unknown, (void)n, (void)known, (void)m, (void)given, (void)found;
    return fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)c, (void)vr, (void)n, (void)order, (void)value;
    return fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[])
{
    (void)c, (void)vr, (void)n, (void)order, (void)value;
    return fmi2Error;
}

#define STATUS(name, type)                                                                        \
    fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value)                      \
    {                                                                                             \
        (void)c, (void)kind, (void)value;                                                         \
        return fmi2Discard;                                                                       \
    }
STATUS(fmi2GetStatus, fmi2Status)
STATUS(fmi2GetRealStatus, fmi2Real)
STATUS(fmi2GetIntegerStatus, fmi2Integer)
STATUS(fmi2GetBooleanStatus, fmi2Boolean)
STATUS(fmi2GetStringStatus, fmi2String)
