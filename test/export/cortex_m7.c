/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Start of a Cortex-M7 on QEMU's board mps2-an500, all in RAM, and its timer. QEMU with
 * -icount shift=0 counts an instruction as 1 ns, and the timer ticks at 25 MHz.
 */
#include <stdint.h>

double count_instructions(void);
extern void _start(void);
extern uint32_t stack_top;
void reset(void);

static volatile uint32_t *const timer = (volatile uint32_t *)0x40000000;

void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* the floating-point unit, on */
    __asm volatile("dsb\n isb");
    timer[2] = 0xFFFFFFFFu; /* reload */
    timer[1] = 0xFFFFFFFFu; /* value, counts down */
    timer[0] = 1;
    _start();
}

static void hang(void)
{
    for (;;)
        ;
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &stack_top, (void *)reset, (void *)hang, (void *)hang, (void *)hang, (void *)hang,
    (void *)hang, 0, 0, 0, 0, (void *)hang, (void *)hang, 0, (void *)hang, (void *)hang};

double count_instructions(void)
{
    return 40.0 * (double)(0xFFFFFFFFu - timer[1]);
}
